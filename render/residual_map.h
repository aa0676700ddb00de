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

/// Percentages of the judged area that are in, over and under tolerance, and uncut.
struct TolerancePercentages {
  double in = 0.0, over = 0.0, under = 0.0, uncut = 0.0;
};
/// A residual map with the information stated beside it.
struct MapPicture {
  std::string title;
  Field field;
  Figures figures;  ///< PV, RMS and mean of the field
  std::string datum = "none";
  std::string alignment = "none";
  std::vector<std::string> caption;  ///< further lines
  std::string verdict{};             ///< "FAIL by 3.2 µm at ..."; empty without a tolerance
  std::optional<TolerancePercentages> percentages{};  ///< by default those of the field
  cutting::ToleranceBands tolerance_um{};  ///< (n) limits of each vertex; no rows: no tolerance
};

/// Returns the percentages of a field. Vertices are weighted by their area, or equally if the field
/// has no areas.
TolerancePercentages tolerance_percentages(const Field& field,
                                           const cutting::ToleranceBands& tolerance_um);

enum class MapColours {
  Diverging,
  Cividis,
  Tolerance,  ///< one colour each for in, over and under tolerance
};

struct MapOptions {
  int width = 1600;                ///< px
  int height = 1200;               ///< px
  std::optional<double> range_um;  ///< the scale is -range .. +range; by default fitted
  MapColours colours = MapColours::Diverging;
  PictureFormat format = PictureFormat::Png;
  bool isolines = false;  ///< draws isolines at the ticks of the scale or the tolerance limits
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the eye
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// Least half range of a fitted scale, on which the numerical error is nearly white.
inline constexpr double min_range_um = 1e-3;

/// Returns the half range, micrometres, of the symmetric scale that contains 99.5 % of the cut
/// vertices, rounded up to 1, 1.5, 2, 3, 4, 5, 6 or 8 x 10^k; at least `min_range_um`.
double fitted_range_um(const Field& field);

/// Returns the ends of a scale fitted to the values. If values have both signs, the ends are
/// -range and +range; a side with values below a quarter of the range is shortened. If all values
/// have one sign, the scale starts at zero, or near the smallest magnitude if that exceeds 40 % of
/// the largest.
Span fitted_ends_um(const Field& field);

/// Returns the ends of a scale that contains several others. It is about zero, with a side
/// shortened as above, or starts at zero if all values have one sign.
Span common_ends(const std::vector<Span>& ends_um);

/// Draws a residual map. The design fills the picture in a parallel projection; its colours show
/// the deviation, and equal values have equal colours. The scale is diverging about zero, or from
/// light to dark for values of one sign; uncut areas are grey. Beside the map are a colour bar with
/// histogram, flags at the highest and lowest vertex, figures, percentages in tolerance, sign
/// convention, datum, alignment, view, scale bar and the number of vertices. The unit is nm if the
/// scale ends below 0.1 µm.
/// @throws std::invalid_argument if sizes do not match, the range is not positive, or the colours
///         of a tolerance are requested without one
/// @throws std::system_error with the path if the file cannot be written
void write_map(const std::filesystem::path& path, const MapPicture& picture,
               const MapOptions& options = {});

/// Returns the same map as pixels; the format of the options is ignored.
/// @throws std::invalid_argument as `write_map`
Pixels map_pixels(const MapPicture& picture, const MapOptions& options = {});

inline constexpr const char* sign_convention =
    "+ material left, − gouged; along the outward design normal";

enum class Mean { Stated, Omitted };
/// Returns e.g. "PV 12.3 µm   RMS 2.34 µm   mean +0.12 µm", in nm if all are below 0.1 µm. Figures
/// that are NaN are omitted.
std::string figures_text(const Figures& figures, Mean mean = Mean::Stated);

/// Returns texts about the judged vertices that the figures exclude: "12 uncut (3.1 %)", "4 gouged
/// deeper than the band".
std::vector<std::string> excluded_text(const VertexCounts& counts);

/// Returns e.g. "−2 to +8 µm", or "by region" if vertices have different limits.
std::string limits_text(const cutting::ToleranceBands& tolerance_um);

/// Returns e.g. "FAIL by 3.2 µm at ...  ·  92.1 % of the area in tolerance, over 5.2 %, under 2.7
/// %"; percentages are of the judged area.
std::string verdict_text(const MapPicture& picture);

/// Returns the lines of text below a map.
std::vector<std::string> map_text(const MapPicture& picture, const VertexCounts& counts,
                                  double range_um, const std::string& view);

}  // namespace abbe::render
