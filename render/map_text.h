#pragma once

#include <string>
#include <vector>

#include "render/map.h"
#include "render/surface_scene.h"

/// What is said in words with a map.
namespace abbe::render {

inline constexpr const char* sign_convention =
    "+ material left, − gouged; along the outward design normal";

/// "PV 12.3 µm   RMS 2.34 µm   mean +0.12 µm", in nm where all of it is below 0.1 µm; what is NaN
/// is left out.
enum class Mean { Stated, LeftOut };
std::string figures_text(const Figures& figures, Mean mean = Mean::Stated);

/// "0.31 % of the cut vertices lie beyond the scale, from −31.2 to +40.0 µm"; empty if none does.
std::string beyond_text(const Tally& counts, double range_um);

/// "12 uncut (3.1 %)", "4 gouged deeper than the band": what of the judged vertices the figures
/// leave out.
std::vector<std::string> left_out_text(const Tally& counts);

/// "−2 to +8 µm", or "by region" where vertices have different ones.
std::string limits_text(const cutting::ToleranceBands& tolerance_um);

/// "FAIL by 3.2 µm at ...  ·  92.1 % of the area in tolerance, over 5.2 %, under 2.7 %", of the
/// judged area.
std::string verdict_text(const MapPicture& picture);

/// The limits that are the same for all vertices; none where they differ, or without a tolerance.
std::optional<Span> common_limits(const cutting::ToleranceBands& tolerance_um);

/// The lines below a map.
std::vector<std::string> map_text(const MapPicture& picture, const Tally& counts, double range_um,
                                  const std::string& view);

}  // namespace abbe::render
