#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "render/canvas.h"
#include "render/figures.h"

namespace abbe::render {

struct HistogramOptions {
  std::string title;
  int width = 1600;                                   ///< px
  int height = 900;                                   ///< px
  std::optional<std::array<double, 2>> tolerance_um;  ///< lower and upper limit, drawn as lines
  std::vector<std::string> caption;                   ///< further lines
  std::optional<Figures> figures = {};                ///< stated figures; by default those of the
                                                      ///< values
};

/// Draws the distribution of the deviation over the area: a histogram with bins of a round width,
/// lines for the mean and the tolerance, and PV, RMS and mean as text. The unit is nm if everything
/// is below 0.1 µm. If outliers would compress the histogram, the axis covers 99.9 % of the area
/// and the picture states how much is beyond.
/// @param deviation_um  (n); values that are not finite (uncut) are excluded
/// @param weights       (n) >= 0, areas of the vertices
/// @throws std::invalid_argument if sizes differ or a weight is negative or not finite
/// @throws std::system_error with the path if the file cannot be written
void write_histogram(const std::filesystem::path& path, const Eigen::VectorXd& deviation_um,
                     const Eigen::VectorXd& weights, const HistogramOptions& options = {});

/// A curve through points in order; a point that is not finite is a gap.
struct ProfileSeries {
  std::string name;
  Eigen::VectorXd x;
  Eigen::VectorXd y;
};

struct ProfileOptions {
  std::string title;
  std::string x_label = "x / mm";
  std::string y_label = "deviation / µm";
  int width = 1600;  ///< px
  int height = 900;  ///< px
  std::vector<std::string> caption;
  PictureFormat format = PictureFormat::Png;
};

/// Draws curves over a common abscissa, with axes and legend.
/// @throws std::invalid_argument if there is no series, or x and y of one have different sizes
/// @throws std::system_error with the path if the file cannot be written
void write_profile(const std::filesystem::path& path, const std::vector<ProfileSeries>& series,
                   const ProfileOptions& options = {});

enum class CurveStyle { Line, Points, LineAndPoints };

/// A series of a panel; a point that is not finite is a gap.
struct Series {
  std::string name{};  ///< in the legend; empty: not listed
  Eigen::VectorXd x;
  Eigen::VectorXd y;
  Eigen::VectorXd lower;  ///< lower edge of a shaded band around the curve; empty: no band
  Eigen::VectorXd upper;  ///< upper edge of the band
  CurveStyle curve_style = CurveStyle::Line;
  std::optional<int> colour{};  ///< index of a series colour; by default the index in the panel
};

/// One diagram of a picture.
struct Panel {
  std::string title{};
  std::string x_label{};
  std::string y_label{};
  std::vector<Series> series{};
  std::vector<std::string> note{};     ///< at the right, below the legend
  std::vector<std::string> x_names{};  ///< tick labels at x = 0, 1, 2 ...; empty: numbers
};

struct CurvesOptions {
  std::string title{};
  int columns = 1;        ///< number of panels side by side
  bool common_y = false;  ///< all panels have the same range of y
  int width = 1600;       ///< px
  int panel_height = 0;   ///< px of one row of panels; 0: 700 for a single row, else 520
  std::vector<std::string> caption{};
};

/// Draws panels of points, lines and bands, each with its own axes, legend and note.
/// @throws std::invalid_argument if there is no panel, a panel has no series, the arrays of a
/// series
///         have different sizes, a band has one edge only, or the picture is higher than 16384 px
/// @throws std::system_error with the path if the file cannot be written
void write_curves(const std::filesystem::path& path, const std::vector<Panel>& panels,
                  const CurvesOptions& options = {});

struct GridOptions {
  std::string title{};
  int columns = 0;        ///< number of panels side by side; 0: a sheet that is about square
  bool common_y = false;  ///< all panels have the same range of y
  int width = 2400;       ///< px
  std::vector<std::string> caption{};
};

/// Draws a sheet of many small panels. The legend is that of the first panel; the notes are beside
/// the titles.
/// @throws as write_curves
void write_grid(const std::filesystem::path& path, const std::vector<Panel>& panels,
                const GridOptions& options = {});

/// A trace of a circular test.
struct PolarTrace {
  std::string name{};
  Eigen::VectorXd angle;         ///< rad, from the first axis to the second
  Eigen::VectorXd deviation_um;  ///< radial, positive outwards
};

struct PolarOptions {
  std::string title{};
  std::string first_axis = "X";
  std::string second_axis = "Y";
  double division_um = 0.0;         ///< distance of the circles; 0: a round value that fits
  std::vector<std::string> note{};  ///< at the right, below the legend
  std::vector<std::string> caption{};
  int width = 1500;   ///< px
  int height = 1200;  ///< px
};

/// Draws radial deviations, magnified about the nominal circle, with circles one division apart.
/// @throws std::invalid_argument if there is no trace, or the arrays of one have different sizes
/// @throws std::system_error with the path if the file cannot be written
void write_polar(const std::filesystem::path& path, const std::vector<PolarTrace>& traces,
                 const PolarOptions& options = {});

/// A horizontal bar.
struct Bar {
  std::string label{};
  double value = 0.0;         ///< not finite: a label without a bar
  std::optional<double> u{};  ///< half length of the whisker at the end of the bar
  int colour = 0;             ///< index of a series colour
  std::optional<double>
      second_value{};  ///< value of a second bar in the same row, in the next colour, as in a
                       ///< tornado diagram; bars of the same sign take half of the row each
  std::string text{};  ///< text at the right, instead of the value
};

struct BarsOptions {
  std::string title{};
  std::string x_label{};
  std::optional<double> reference{};  ///< a vertical line
  std::string reference_label{};
  bool from_zero = true;  ///< if false, the axis begins near the smallest value
  int width = 1600;       ///< px
  std::vector<std::string> caption{};
  std::vector<std::string> legend{};  ///< meaning of series colours 0, 1 ... of the bars
  std::string running_sum{};  ///< name of the line of cumulative sums in a Pareto diagram; empty:
                              ///< no line
};

/// Draws labelled bars from top to bottom, each with its value.
/// @throws std::invalid_argument for no bar or more than 400
/// @throws std::system_error with the path if the file cannot be written
void write_bars(const std::filesystem::path& path, const std::vector<Bar>& bars,
                const BarsOptions& options = {});

}  // namespace abbe::render
