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
#include "render/plot.h"
#include "render/residual_field.h"
#include "render/residual_map.h"
#include "sim/files/output.h"
#include "sim/report/result_pictures.h"

namespace abbe::sim {
namespace {

/// Returns the file of the map; `result` is the file or its folder.
std::filesystem::path map_file(const std::filesystem::path& result) {
  return std::filesystem::is_directory(result) ? result / "residual.vtp" : result;
}

/// Returns a - b for two results on the same design. A vertex is cut only if it is cut in both.
/// @param other  file of b, for messages
/// @throws BadInput if the designs differ
render::Field difference(render::Field a, const render::Field& b,
                         const std::filesystem::path& other) {
  if (a.deviation_um.size() != b.deviation_um.size())
    throw BadInput(other.string(), 0, 0,
                   fmt::format("{} vertices, as in the first result", a.deviation_um.size()),
                   fmt::format("{}", b.deviation_um.size()));
  if (a.design.vertices != b.design.vertices)
    throw BadInput(other.string(), 0, 0, "the same design as in the first result",
                   "different vertices");
  a.deviation_um -= b.deviation_um;
  for (std::size_t i = 0; i < a.status.size(); ++i)
    a.status[i] = std::uint8_t(cutting::worse_status(cutting::VertexStatus(a.status[i]),
                                                     cutting::VertexStatus(b.status[i])));
  // Points inside triangles can be subtracted only if both maps sampled the same points.
  if (a.interior_sample == b.interior_sample && a.within_um.size() == b.within_um.size()) {
    a.within_um -= b.within_um;
  } else {
    a.interior_sample = cutting::Surface::InteriorSample::None;
    a.within_um.resize(0);
  }
  if (a.form_um.size() == b.form_um.size())
    a.form_um -= b.form_um;
  else
    a.form_um.resize(0);
  a.tolerance_um.resize(0, 2);  // a tolerance applies to a part, not to a difference of two parts
  for (Eigen::Index i = 0; i < a.deviation_um.size(); ++i)
    if (a.status[std::size_t(i)] != 0) a.deviation_um[i] = std::numeric_limits<double>::quiet_NaN();
  return a;
}

/// The part of a profile that lies in one triangle.
struct ProfileSegment {
  double from, to;      ///< mm, coordinates along the line
  double first, last;   ///< um, deviation at these ends
  double weight = 0.0;  ///< in means over a bin
};

/// Returns the centre of the bounding box of a part.
Eigen::RowVector3d box_centre(const render::Field& field) {
  const auto& vertices = field.design.vertices;
  return 0.5 * (vertices.colwise().minCoeff() + vertices.colwise().maxCoeff());
}

/// Returns the section of a map by the plane through the centre of the part normal to x or y, with
/// a segment per triangle in the order of the file.
/// @param across  normal of the plane: 0 is x, 1 is y
std::vector<ProfileSegment> section_segments(const render::Field& field, int across) {
  const double level = box_centre(field)[across];
  const auto& vertices = field.design.vertices;
  std::vector<ProfileSegment> segments;
  for (const auto& t : field.design.triangles.rowwise()) {
    std::vector<std::pair<double, double>> ends;  // coordinate, deviation
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      const double p = vertices(a, across) - level, q = vertices(b, across) - level;
      if ((p < 0.0) == (q < 0.0)) continue;
      const double u = p / (p - q);
      ends.emplace_back((1.0 - u) * vertices(a, 1 - across) + u * vertices(b, 1 - across),
                        (1.0 - u) * field.deviation_um[a] + u * field.deviation_um[b]);
    }
    if (ends.size() != 2) continue;
    std::sort(ends.begin(), ends.end());
    const auto& [from, first] = ends[0];
    const auto& [to, last] = ends[1];
    if (std::isfinite(first) && std::isfinite(last))
      segments.push_back({from, to, first, last, to - from});
  }
  return segments;
}

/// Returns the segments of a profile. A profile over the radius consists of the vertices, each
/// weighted by its area.
/// @param line  "x", "y" or "radius"
std::vector<ProfileSegment> profile_segments(const render::Field& field, const std::string& line) {
  if (line == "x") return section_segments(field, 1);
  if (line == "y") return section_segments(field, 0);
  std::vector<ProfileSegment> segments;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    const double r = field.design.vertices.row(i).head<2>().norm(), d = field.deviation_um[i];
    if (std::isfinite(d)) segments.push_back({r, r, d, d, field.design.area[i]});
  }
  return segments;
}

/// Returns the description of a line for captions and messages.
std::string line_description(const render::Field& field, const std::string& line) {
  if (line == "radius") return "the distance from the z axis of the part, over all angles";
  return line == "x"
             ? fmt::format("x through the middle of the part, y = {:.3f} mm", box_centre(field).y())
             : fmt::format("y through the middle of the part, x = {:.3f} mm",
                           box_centre(field).x());
}

/// Removes bins without vertices from a profile over the radius: if the vertices of a part are on
/// rings, some bins are empty although the part has no gap there. Bins that have only uncut
/// vertices remain as gaps.
std::vector<render::ProfileSeries> remove_empty_bins(const render::Field& field,
                                                     std::vector<render::ProfileSeries> profile) {
  const Eigen::Index bins = profile.front().x.size();
  const double first = profile.front().x.minCoeff<Eigen::PropagateNumbers>();
  const double last = profile.front().x.maxCoeff<Eigen::PropagateNumbers>();
  std::vector<Eigen::Index> remaining;
  std::vector<char> has_uncut(std::size_t(bins), 0);
  for (Eigen::Index v = 0; v < field.deviation_um.size(); ++v) {
    const double r = field.design.vertices.row(v).head<2>().norm();
    if (std::isfinite(field.deviation_um[v]) || !(r >= first && r <= last && last > first))
      continue;
    has_uncut[std::size_t(std::lround((r - first) / (last - first) * double(bins - 1)))] = 1;
  }
  for (Eigen::Index k = 0; k < bins; ++k)
    if (has_uncut[std::size_t(k)] != 0 || std::isfinite(profile.front().x[k]))
      remaining.push_back(k);
  for (render::ProfileSeries& series : profile) {
    series.x = Eigen::VectorXd(series.x(remaining));
    series.y = Eigen::VectorXd(series.y(remaining));
  }
  return profile;
}

/// Returns the highest, mean and lowest deviation in bins along a line, because a curve through
/// every cusp would be unreadable.
std::vector<render::ProfileSeries> profile(const render::Field& field, const std::string& line) {
  constexpr int bins = 200;
  const std::vector<ProfileSegment> segments = profile_segments(field, line);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<render::ProfileSeries> profile = {
      {"highest", {}, {}}, {"mean", {}, {}}, {"lowest", {}, {}}};
  for (render::ProfileSeries& series : profile)
    series.x = series.y = Eigen::VectorXd::Constant(bins, nan);
  if (segments.empty()) return profile;
  double from = segments.front().from, to = segments.front().to;
  for (const ProfileSegment& segment : segments) {
    from = std::min(from, segment.from);
    to = std::max(to, segment.to);
  }
  const double step = (to - from) / bins;
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(bins);
  const auto add_point = [&](double x, double y, double point_weight) {
    const int k = step > 0.0 ? std::clamp(int((x - from) / step), 0, bins - 1) : 0;
    for (render::ProfileSeries& series : profile) {
      series.x[k] = from + (k + 0.5) * step;
      if (std::isnan(series.y[k])) series.y[k] = &series == &profile[1] ? 0.0 : y;
    }
    profile[0].y[k] = std::max(profile[0].y[k], y);
    profile[1].y[k] += point_weight * y;
    profile[2].y[k] = std::min(profile[2].y[k], y);
    weight[k] += point_weight;
  };
  for (const ProfileSegment& segment : segments) {
    // At least four points per bin, so that a long triangle leaves no bin empty.
    const int points = step > 0.0 ? 1 + int(4.0 * (segment.to - segment.from) / step) : 1;
    for (int i = 0; i < points; ++i) {
      const double u = (i + 0.5) / points;
      add_point(std::lerp(segment.from, segment.to, u), std::lerp(segment.first, segment.last, u),
                segment.weight / points);
    }
  }
  for (int k = 0; k < bins; ++k)
    profile[1].y[k] = weight[k] > 0.0 ? profile[1].y[k] / weight[k] : nan;
  return line == "radius" ? remove_empty_bins(field, profile) : profile;
}

/// Facts in the summary file of a result.
struct ResultFacts {
  std::string title;
  std::string datum = "unknown";
  std::string alignment = "unknown";
  std::optional<Tolerance> tolerance;  ///< mm
  std::optional<double> form_cutoff;   ///< mm
  std::optional<Eigen::Vector3d> from, up;
};

/// Returns the list of numbers under a key; empty if there is none, or if an entry is not a number.
std::optional<Eigen::VectorXd> numbers_in(const nlohmann::json& json, const char* key) {
  if (!json.is_object() || !json.contains(key) || !json[key].is_array()) return std::nullopt;
  Eigen::VectorXd values(Eigen::Index(json[key].size()));
  for (std::size_t i = 0; i < json[key].size(); ++i) {
    if (!json[key][i].is_number()) return std::nullopt;
    values[Eigen::Index(i)] = json[key][i].get<double>();
  }
  return values;
}

/// Reads the summary beside a result. It is not necessary for a picture, so a missing, damaged or
/// incomplete file is not an error.
ResultFacts read_facts(const std::filesystem::path& result) {
  ResultFacts facts;
  facts.title = result.parent_path().filename().string();
  std::ifstream in(result.parent_path() / "summary.json");
  const auto json = nlohmann::json::parse(in, nullptr, false);
  if (!json.is_object()) return facts;
  const auto read_text_member = [&](const char* key, std::string& value) {
    if (json.contains(key) && json[key].is_string()) value = json[key].get<std::string>();
  };
  std::string scene, name = facts.title;
  read_text_member("scene", scene);
  read_text_member("case", name);
  read_text_member("datum", facts.datum);
  read_text_member("alignment", facts.alignment);
  facts.title = scene.empty() ? name : scene + ": " + name;
  if (const auto limits = numbers_in(json, "tolerance_um"); limits && limits->size() == 2)
    facts.tolerance = Tolerance{(*limits)[0] * units::um, (*limits)[1] * units::um};
  if (json.contains("form_cutoff_mm") && json["form_cutoff_mm"].is_number()) {
    const double cutoff = json["form_cutoff_mm"].get<double>();
    if (std::isfinite(cutoff) && cutoff > 0.0) facts.form_cutoff = cutoff;
  }
  if (!json.contains("view")) return facts;
  const auto from = numbers_in(json["view"], "from"), up = numbers_in(json["view"], "up");
  if (from && up && from->size() == 3 && up->size() == 3) {
    facts.from = Eigen::Vector3d(*from);
    facts.up = Eigen::Vector3d(*up);
  }
  return facts;
}

/// Returns the format "svg", "pdf" or, for any other name, PNG.
render::PictureFormat picture_format(const std::string& name) {
  return name == "svg"   ? render::PictureFormat::Svg
         : name == "pdf" ? render::PictureFormat::Pdf
                         : render::PictureFormat::Png;
}

/// Returns the options of a map.
/// @param has_tolerance  of the result or of --bands
/// @throws BadInput for colours by tolerance without a tolerance
render::MapOptions map_options(const RenderOptions& options, const ResultFacts& facts,
                               bool has_tolerance) {
  render::MapOptions map;
  if (facts.from) map.from = *facts.from;
  if (facts.up) map.up = *facts.up;
  if (options.from) {
    map.from = *options.from;
    // z is up, since the view direction of --from may be parallel to the up direction of the
    // result.
    map.up = Eigen::Vector3d::UnitZ();
  }
  if (options.size)
    std::tie(map.width, map.height) = std::pair((*options.size)[0], (*options.size)[1]);
  map.range_um = options.range_um;
  map.isolines = options.isolines;
  map.format = picture_format(options.format);
  const std::string colours =
      options.colours.empty() ? (options.bands ? "tolerance" : "diverging") : options.colours;
  if (colours == "tolerance" && !has_tolerance)
    throw BadInput(options.result.string(), 0, 0,
                   "--bands, or a result with a tolerance in its summary.json", "neither");
  map.colours = colours == "tolerance" ? render::MapColours::Tolerance
                : colours == "cividis" ? render::MapColours::Cividis
                                       : render::MapColours::Diverging;
  return map;
}

/// Returns the primary, waviness and roughness profiles of a line by ISO 21920.
/// @throws BadInput if nothing is cut along the line
LineTexture result_texture(const RenderOptions& options, const std::filesystem::path& source,
                           const render::Field& field, const ResultFacts& facts) {
  const ProfiledMap map{field.design, field.deviation_um, field.interior_sample, field.within_um};
  std::optional<LineTrace> trace = line_trace(map, parse_profile_line(*options.line));
  if (!trace)
    throw BadInput(source.string(), 0, 0, "a part that is cut along " + *options.line,
                   "no cut vertices along " + line_description(field, *options.line));
  trace->residual *= units::um;
  if (trace->interpolation) {
    trace->interpolation->rms *= units::um;
    trace->interpolation->max *= units::um;
  }
  LineTexture texture = line_texture(std::move(*trace), facts.form_cutoff, options.texture);
  texture.line = *options.line;
  texture.position = *options.line == "radius" ? "the radius from the z axis of the part towards +x"
                                               : line_description(field, *options.line);
  return texture;
}

/// Returns the waviness plus the line that was removed before filtering, thinned for drawing.
render::ProfileSeries waviness_series(const LineTexture& texture) {
  constexpr Eigen::Index max_points = 2000;  // of the drawn curve
  const Eigen::VectorXd along = values_on_profile(texture, texture.trace.along);
  const Eigen::VectorXd height = texture.texture.waviness + texture.texture.line;
  const Eigen::Index n = std::min(max_points, along.size());
  render::ProfileSeries series{"mean line of Nic", Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index k = i * (along.size() - 1) / (n - 1);
    series.x[i] = along[k];
    series.y[i] = height[k] / units::um;
  }
  return series;
}

/// Draws the profile along a line and writes it with its parameters as JSON and CSV.
RenderOutcome render_profile(const RenderOptions& options, const std::filesystem::path& source,
                             const ResultFolder& folder, const render::Field& field,
                             const ResultFacts& facts) {
  const render::Figures numbers = figures(render::statistics(field));
  RenderOutcome outcome;
  outcome.texture = result_texture(options, source, field, facts);
  const LineTexture& texture = *outcome.texture;
  render::ProfileOptions plot;
  plot.title = facts.title;
  plot.x_label = *options.line + " / mm";
  plot.caption = {"+ material left, − gouged; along the outward design normal",
                  "along " + line_description(field, *options.line),
                  fmt::format("whole map: PV {:.4g} µm, RMS {:.4g} µm; datum {}, alignment {}",
                              numbers.pv_um, numbers.rms_um, facts.datum, facts.alignment),
                  main_settings(texture), main_parameters(texture)};
  if (const std::string warning = resolution_warning(texture); !warning.empty())
    plot.caption.push_back(warning);
  plot.format = picture_format(options.format);
  if (options.size)
    std::tie(plot.width, plot.height) = std::pair((*options.size)[0], (*options.size)[1]);
  std::vector<render::ProfileSeries> series = profile(field, *options.line);
  series.push_back(waviness_series(texture));
  const std::string name = "profile-" + *options.line;
  const ResultFile picture_file = folder / (name + "." + options.format);
  write_file(picture_file,
             [&](const std::filesystem::path& file) { render::write_profile(file, series, plot); });
  outcome.picture = picture_file.path();
  const ResultFile json = folder / (name + ".json"), csv = folder / (name + ".csv");
  write_json(json, to_json(texture));
  write_table(csv, to_csv(texture));
  outcome.files = {json.path(), csv.path()};
  return outcome;
}

}  // namespace

RenderOutcome render_result(const RenderOptions& options) {
  const std::filesystem::path source = map_file(options.result);
  render::Field field = render::read_residual(source);
  ResultFacts facts = read_facts(source);
  if (options.minus) {
    const std::filesystem::path other_file = map_file(*options.minus);
    field = difference(std::move(field), render::read_residual(other_file), other_file);
    const std::string other_title = read_facts(other_file).title;
    const auto folder = [](const std::filesystem::path& file) {
      return file.parent_path().filename().string();
    };
    if (other_title == facts.title && folder(source) != folder(other_file))
      facts.title += fmt::format(", {} minus {}", folder(source), folder(other_file));
    else
      facts.title += ", minus " + other_title;
    facts.tolerance.reset();  // a tolerance applies to a part, not to a difference of two parts
  }
  // The files of the result are inputs and must not be overwritten.
  Writer writer{options.permissions, {source, source.parent_path() / "summary.json"}, true};
  if (options.minus) writer.inputs.push_back(map_file(*options.minus));
  const ResultFolder folder(options.out.empty() ? source.parent_path() : options.out, writer);
  if (options.line) return render_profile(options, source, folder, field, facts);
  render::MapPicture picture;
  picture.title = facts.title;
  picture.figures = figures(render::statistics(field));
  picture.datum = facts.datum;
  picture.alignment = facts.alignment;
  if (const auto bands = options.bands ? options.bands : facts.tolerance)
    picture.tolerance_um = Eigen::RowVector2d(bands->lower / units::um, bands->upper / units::um)
                               .replicate(field.deviation_um.size(), 1);
  if (!options.bands && field.tolerance_um.rows() > 0) picture.tolerance_um = field.tolerance_um;
  if (picture.tolerance_um.rows() > 0) {
    const auto conformance =
        render::statistics(field, picture.tolerance_um * units::um).conformance;
    if (conformance) picture.percentages = percentages(*conformance);
  }
  picture.field = std::move(field);
  const render::MapOptions map = map_options(options, facts, picture.tolerance_um.rows() > 0);
  // A run never writes pictures with these names, so none of its pictures is replaced.
  const ResultFile picture_file =
      folder / ((options.minus ? "difference." : "rendered.") + options.format);
  write_file(picture_file,
             [&](const std::filesystem::path& file) { render::write_map(file, picture, map); });
  if (options.minus)
    write_file(folder / "difference.vtp", [&](const std::filesystem::path& file) {
      render::write_residual(file, picture.field);
    });
  RenderOutcome outcome{picture_file.path(), {}, {}};
  if (options.minus) outcome.files.push_back((folder / "difference.vtp").path());
  return outcome;
}

}  // namespace abbe::sim

#else

namespace abbe::sim {

RenderOutcome render_result(const RenderOptions& options) {
  throw BadInput(options.result.string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "a program built without VTK");
}

}  // namespace abbe::sim

#endif
