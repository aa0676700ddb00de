#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/map/residual.h"
#include "render/canvas.h"
#include "render/figures.h"
#include "render/layout.h"
#include "render/residual_field.h"
#include "render/surface_scene.h"

namespace abbe::render {

/// How much of the judged area of a field lies where, percent.
struct ToleranceShares {
  double in = 0.0, over = 0.0, under = 0.0, uncut = 0.0;
};
/// A residual map and all that must be said with it.
struct MapPicture {
  std::string title;
  Field field;
  Figures figures;  ///< of this field
  std::string datum = "none";
  std::string alignment = "none";
  std::vector<std::string> caption;         ///< further lines
  std::string verdict{};                    ///< "FAIL by 3.2 µm at ..."; empty without a tolerance
  std::optional<ToleranceShares> shares{};  ///< else those of the field
  cutting::ToleranceBands tolerance_um{};   ///< of each vertex, or no rows: no tolerance
};

/// Where the field has no areas all vertices are alike.
ToleranceShares tolerance_shares(const Field& field, const cutting::ToleranceBands& tolerance_um);

enum class MapColours {
  Diverging,
  Cividis,
  Tolerance,  ///< in, over, under
};

struct MapOptions {
  int width = 1600;                ///< px
  int height = 1200;               ///< px
  std::optional<double> range_um;  ///< scale is -range .. +range; else fitted
  MapColours colours = MapColours::Diverging;
  PictureFormat format = PictureFormat::Png;
  bool isolines = false;  ///< at the ticks of the scale, or at the limits of the tolerance
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the eye
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// Below it a residual is rounding: the surface engine's bound. No flag says more of it.
inline constexpr double numerical_floor_um = 1e-4;

/// The finest half range of a scale that is fitted: on it the floor is nearly white.
inline constexpr double min_range_um = 1e-3;

/// Half range of the symmetric scale on which 99.5 % of the cut vertices lie, rounded up to
/// 1, 1.5, 2, 3, 4, 5, 6 or 8 x 10^k, at least `min_range_um`; micrometres.
double fitted_range_um(const Field& field);

/// Ends of a scale fitted in the same way: -range .. +range where values have both signs, without
/// most of a side that has less than a quarter of it; where all have one sign it begins at zero, or
/// near the smallest if that is beyond 40 % of the largest.
Span fitted_ends_um(const Field& field);

/// Ends that hold all of these: about zero, a side cut short as above, or from zero where none
/// crosses it.
Span common_ends(const std::vector<Span>& ends_um);

/// Draws the map: the design fills the picture in a parallel projection, coloured by deviation on a
/// diverging scale symmetric about zero (of values of one sign on the whole scale), equal values in
/// equal colours, uncut grey, with colour bar and histogram, flags at the highest and lowest
/// vertex, figures, shares in tolerance, sign convention, datum, alignment, view, scale bar and the
/// number of vertices. In nm where the scale ends below 0.1 µm.
/// @throws std::invalid_argument if sizes do not fit, the range is not positive, or the colours of
///         a tolerance are asked for where there is none
/// @throws std::system_error with the path if the file cannot be written
void write_map(const std::filesystem::path& path, const MapPicture& picture,
               const MapOptions& options = {});

/// The same map as it is on a screen; the format of the options does not matter.
/// @throws std::invalid_argument as `write_map`
Pixels map_pixels(const MapPicture& picture, const MapOptions& options = {});

// What is said in words with a map.

inline constexpr const char* sign_convention =
    "+ material left, − gouged; along the outward design normal";

/// "PV 12.3 µm   RMS 2.34 µm   mean +0.12 µm", in nm where all of it is below 0.1 µm; what is NaN
/// is left out.
enum class Mean { Stated, Omitted };
std::string figures_text(const Figures& figures, Mean mean = Mean::Stated);

/// "0.31 % of the cut vertices lie beyond the scale, from −31.2 to +40.0 µm"; empty if none does.
std::string outlier_text(const Tally& counts, double range_um);

/// "12 uncut (3.1 %)", "4 gouged deeper than the band": what of the judged vertices the figures
/// leave out.
std::vector<std::string> excluded_text(const Tally& counts);

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
