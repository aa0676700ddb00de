#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/residual.h"
#include "render/axes.h"
#include "render/canvas.h"
#include "render/field.h"
#include "render/figures.h"

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
inline constexpr double least_range_um = 1e-3;

/// Half range of the symmetric scale on which 99.5 % of the cut vertices lie, rounded up to
/// 1, 1.5, 2, 3, 4, 5, 6 or 8 x 10^k, at least `least_range_um`; micrometres.
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

}  // namespace abbe::render
