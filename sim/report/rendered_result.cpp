#include "sim/report/rendered_result.h"

#include "kinematics/bad_input.h"

#if ABBE_RENDER

#include <algorithm>
#include <cmath>
#include <fstream>
#include <tuple>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "render/field.h"
#include "render/figures.h"
#include "render/map.h"
#include "render/plot.h"
#include "sim/files/output.h"

namespace abbe::sim {
namespace {

std::filesystem::path result_file(const std::filesystem::path& result) {
  return std::filesystem::is_directory(result) ? result / "residual.vtp" : result;
}

render::Field difference(render::Field a, const render::Field& b,
                         const std::filesystem::path& other) {
  if (a.deviation_um.size() != b.deviation_um.size())
    throw BadInput(other.string(), 0, 0,
                   fmt::format("{} vertices, as the first result has", a.deviation_um.size()),
                   fmt::format("{}", b.deviation_um.size()));
  if (a.design.vertices != b.design.vertices)
    throw BadInput(other.string(), 0, 0, "the same design as the first result has",
                   "other vertices");
  a.deviation_um -= b.deviation_um;
  for (std::size_t i = 0; i < a.status.size(); ++i)
    a.status[i] = std::uint8_t(
        cutting::worse(cutting::VertexStatus(a.status[i]), cutting::VertexStatus(b.status[i])));
  if (a.middle_um.size() == b.middle_um.size())
    a.middle_um -= b.middle_um;
  else
    a.middle_um.resize(0);
  for (Eigen::Index i = 0; i < a.deviation_um.size(); ++i)
    if (a.status[std::size_t(i)] != 0) a.deviation_um[i] = std::numeric_limits<double>::quiet_NaN();
  return a;
}

/// Points of a map along a line through the middle of the part: (coordinate, deviation).
std::vector<std::pair<double, double>> along(const render::Field& field, const std::string& line) {
  const auto& vertices = field.design.vertices;
  const Eigen::RowVector3d lower = vertices.colwise().minCoeff(),
                           upper = vertices.colwise().maxCoeff();
  const Eigen::RowVector3d middle = 0.5 * (lower + upper);
  const double width = 1.5 * std::sqrt(field.design.area.sum() / double(vertices.rows()));
  std::vector<std::pair<double, double>> points;
  for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
    if (std::isnan(field.deviation_um[i])) continue;
    const Eigen::RowVector3d p = vertices.row(i) - middle;
    if (line == "radius")
      points.emplace_back(std::hypot(vertices(i, 0), vertices(i, 1)), field.deviation_um[i]);
    else if (line == "x" && std::abs(p.y()) < width)
      points.emplace_back(vertices(i, 0), field.deviation_um[i]);
    else if (line == "y" && std::abs(p.x()) < width)
      points.emplace_back(vertices(i, 1), field.deviation_um[i]);
  }
  return points;
}

/// The line of a profile, in words.
std::string where_runs(const std::string& line) {
  if (line == "radius") return "the distance from the part's z axis, all around it";
  return line + " through the middle of the part, a strip of about one and a half vertices to " +
         "either side";
}

/// Lowest, mean and highest deviation in stretches of a line: cusps make a single trace a scribble.
std::vector<render::ProfileSeries> profile(const render::Field& field, const std::string& line) {
  constexpr int stretches = 200;
  const auto points = along(field, line);
  std::vector<render::ProfileSeries> all = {
      {"highest", {}, {}}, {"mean", {}, {}}, {"lowest", {}, {}}};
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (render::ProfileSeries& series : all)
    series.x = series.y = Eigen::VectorXd::Constant(stretches, none);
  if (points.empty()) return all;
  const auto [first, last] = std::minmax_element(points.begin(), points.end());
  const double from = first->first, step = (last->first - from) / stretches;
  std::vector<int> count(stretches, 0);
  for (const auto& [x, y] : points) {
    const int k = step > 0.0 ? std::min(stretches - 1, int((x - from) / step)) : 0;
    for (render::ProfileSeries& series : all) series.x[k] = from + (k + 0.5) * step;
    if (count[std::size_t(k)]++ == 0) {
      for (render::ProfileSeries& series : all) series.y[k] = y;
      continue;
    }
    all[0].y[k] = std::max(all[0].y[k], y);
    all[1].y[k] += y;
    all[2].y[k] = std::min(all[2].y[k], y);
  }
  for (int k = 0; k < stretches; ++k) all[1].y[k] /= std::max(1, count[std::size_t(k)]);
  return all;
}

/// What the summary beside a result says of it, if there is one.
struct About {
  std::string title;
  std::string datum = "not known";
  std::string alignment = "not known";
  std::optional<Tolerance> tolerance;  ///< mm
  std::optional<Eigen::Vector3d> from, up;
};

std::optional<Eigen::VectorXd> numbers_in(const nlohmann::json& json, const char* key) {
  if (!json.is_object() || !json.contains(key) || !json[key].is_array()) return std::nullopt;
  Eigen::VectorXd values(Eigen::Index(json[key].size()));
  for (std::size_t i = 0; i < json[key].size(); ++i) {
    if (!json[key][i].is_number()) return std::nullopt;
    values[Eigen::Index(i)] = json[key][i].get<double>();
  }
  return values;
}

About about(const std::filesystem::path& result) {
  About known{result.parent_path().filename().string()};
  std::ifstream in(result.parent_path() / "summary.json");
  const auto json = nlohmann::json::parse(in, nullptr, false);
  if (!json.is_object()) return known;
  const auto text = [&](const char* key, std::string& into) {
    if (json.contains(key) && json[key].is_string()) into = json[key].get<std::string>();
  };
  std::string scene, name = known.title;
  text("scene", scene);
  text("case", name);
  text("datum", known.datum);
  text("alignment", known.alignment);
  known.title = scene.empty() ? name : scene + ": " + name;
  if (const auto limits = numbers_in(json, "tolerance_um"); limits && limits->size() == 2)
    known.tolerance = Tolerance{(*limits)[0] * units::um, (*limits)[1] * units::um};
  if (!json.contains("view")) return known;
  const auto from = numbers_in(json["view"], "from"), up = numbers_in(json["view"], "up");
  if (from && up && from->size() == 3 && up->size() == 3) {
    known.from = Eigen::Vector3d(*from);
    known.up = Eigen::Vector3d(*up);
  }
  return known;
}

render::PictureFormat format_of(const std::string& word) {
  return word == "svg"   ? render::PictureFormat::Svg
         : word == "pdf" ? render::PictureFormat::Pdf
                         : render::PictureFormat::Png;
}

/// @throws BadInput for colours of a tolerance that nobody gave
render::MapOptions map_options(const RenderOptions& options, const About& known, bool tolerated) {
  render::MapOptions map;
  if (known.from) map.from = *known.from;
  if (known.up) map.up = *known.up;
  if (options.from) {
    map.from = *options.from;
    map.up = Eigen::Vector3d::UnitZ();
  }
  if (options.size)
    std::tie(map.width, map.height) = std::pair((*options.size)[0], (*options.size)[1]);
  map.range_um = options.range_um;
  map.isolines = options.isolines;
  map.format = format_of(options.format);
  const std::string colours =
      options.colours.empty() ? (options.bands ? "tolerance" : "diverging") : options.colours;
  if (colours == "tolerance" && !tolerated)
    throw BadInput(options.result.string(), 0, 0,
                   "--bands, or a result whose summary.json has a tolerance", "neither");
  map.colours = colours == "tolerance" ? render::MapColours::Tolerance
                : colours == "cividis" ? render::MapColours::Cividis
                                       : render::MapColours::Diverging;
  return map;
}

render::Figures figures_of(const render::Field& field) {
  const cutting::Statistics s = render::statistics(field);
  const auto um = [](const std::optional<double>& mm) {
    return mm ? *mm / units::um : std::numeric_limits<double>::quiet_NaN();
  };
  return {um(s.pv), um(s.rms), um(s.mean)};
}

/// A profile along a line instead of a map.
std::filesystem::path render_profile(const RenderOptions& options, const ResultFolder& folder,
                                     const render::Field& field, const About& known) {
  const render::Figures numbers = figures_of(field);
  render::ProfileOptions plot;
  plot.title = known.title;
  plot.x_label = *options.line + " / mm";
  plot.caption = {"+ material left, − gouged; along the outward design normal",
                  "along " + where_runs(*options.line),
                  fmt::format("whole map: PV {:.4g} µm, RMS {:.4g} µm; datum {}, alignment {}",
                              numbers.pv_um, numbers.rms_um, known.datum, known.alignment)};
  plot.format = format_of(options.format);
  if (options.size)
    std::tie(plot.width, plot.height) = std::pair((*options.size)[0], (*options.size)[1]);
  const ResultFile drawn = folder / ("profile-" + *options.line + "." + options.format);
  write_file(drawn, [&](const std::filesystem::path& file) {
    render::write_profile(file, profile(field, *options.line), plot);
  });
  return drawn.path();
}

}  // namespace

std::filesystem::path render_result(const RenderOptions& options) {
  const std::filesystem::path source = result_file(options.result);
  render::Field field = render::read_residual(source);
  About known = about(source);
  if (options.minus) {
    const std::filesystem::path other = result_file(*options.minus);
    field = difference(std::move(field), render::read_residual(other), other);
    known.title += ", minus " + about(other).title;
    known.tolerance.reset();  // it is not a difference that is tolerated
  }
  Writer writer{options.permissions, {source, source.parent_path() / "summary.json"}, true};
  if (options.minus) writer.inputs.push_back(result_file(*options.minus));
  const ResultFolder folder(options.out.empty() ? source.parent_path() : options.out, writer);
  if (options.line) return render_profile(options, folder, field, known);
  render::MapPicture picture;
  picture.title = known.title;
  picture.figures = figures_of(field);
  picture.datum = known.datum;
  picture.alignment = known.alignment;
  if (const auto bands = options.bands ? options.bands : known.tolerance)
    picture.tolerance_um = Eigen::RowVector2d(bands->lower / units::um, bands->upper / units::um)
                               .replicate(field.deviation_um.size(), 1);
  picture.field = std::move(field);
  const render::MapOptions map = map_options(options, known, picture.tolerance_um.rows() > 0);
  // never the name of a picture that a run left there
  const ResultFile drawn =
      folder / ((options.minus ? "difference." : "rendered.") + options.format);
  write_file(drawn,
             [&](const std::filesystem::path& file) { render::write_map(file, picture, map); });
  if (options.minus)
    write_file(folder / "difference.vtp", [&](const std::filesystem::path& file) {
      render::write_residual(file, picture.field);
    });
  return drawn.path();
}

}  // namespace abbe::sim

#else

namespace abbe::sim {

std::filesystem::path render_result(const RenderOptions& options) {
  throw BadInput(options.result.string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "one without VTK");
}

}  // namespace abbe::sim

#endif
