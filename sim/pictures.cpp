#include "sim/pictures.h"

#if ABBE_RENDER

#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/comparison.h"
#include "render/field.h"
#include "render/figures.h"
#include "render/machine.h"
#include "render/map.h"
#include "render/plot.h"
#include "sim/check_scene.h"
#include "sim/output.h"

namespace abbe::sim {
namespace {

double um(const std::optional<double>& value) {
  return value ? *value / units::um : std::numeric_limits<double>::quiet_NaN();
}

render::Figures figures(const cutting::Statistics& s) { return {um(s.pv), um(s.rms), um(s.mean)}; }

std::string datum_name(const Job& job) {
  using Kind = DatumDescription::Kind;
  const Kind kind = job.scene.datum.kind;
  return kind == Kind::None ? "none" : kind == Kind::Ideal ? "ideal" : "touch off";
}

std::string alignment_name(const Job& job) {
  const Alignment alignment = job.scene.alignment;
  return alignment == Alignment::None ? "none" : alignment == Alignment::Offset ? "offset" : "rigid";
}

/// The map in the part frame, so that the camera stands where the scene says, however the part is clamped.
render::MapPicture map_picture(const Job& job, const Verdict& verdict) {
  render::MapPicture picture;
  picture.field = render::field(cutting::transformed(job.design_w, job.scene.part.T_wm.inverse()),
                                verdict.aligned.surface);
  picture.title = verdict.cut.name;
  picture.figures = figures(verdict.residual);
  picture.datum = datum_name(job);
  picture.alignment = alignment_name(job);
  return picture;
}

Eigen::VectorXd deviation_um(const Verdict& verdict) {
  return verdict.aligned.surface.residual / units::um;
}

/// A length in the unit in which it reads best.
std::string length_text(double mm) {
  if (mm >= 0.1 * units::um) return fmt::format("{:.3g} \u00b5m", mm / units::um);
  return mm >= 1e-3 * units::nm ? fmt::format("{:.3g} nm", mm / units::nm) : "under 0.001 nm";
}

/// Compared cases say how far they brought the machine's part down.
std::string reduction_text(const Compared& one, const std::vector<Compared>& cases) {
  if (!one.uncompensated) return "";
  const auto& before = cases[*one.uncompensated].verdict.machine;
  const auto& after = one.verdict.machine;
  if (!before || !after || !before->rms || !after->rms || *before->rms == 0.0) return "";
  const double left = *after->rms / *before->rms;
  return fmt::format("machine {} RMS ({:+.2f} %)", length_text(*after->rms), 100.0 * (left - 1.0));
}

std::filesystem::path result_file(const std::filesystem::path& result) {
  return std::filesystem::is_directory(result) ? result / "residual.vtp" : result;
}

render::Field difference(render::Field a, const render::Field& b, const std::filesystem::path& other) {
  if (a.deviation_um.size() != b.deviation_um.size())
    throw BadInput(other.string(), 0, 0, fmt::format("{} vertices, as the first result has", a.deviation_um.size()),
                   fmt::format("{}", b.deviation_um.size()));
  a.deviation_um -= b.deviation_um;
  for (std::size_t i = 0; i < a.status.size(); ++i) a.status[i] = std::max(a.status[i], b.status[i]);
  for (Eigen::Index i = 0; i < a.deviation_um.size(); ++i)
    if (a.status[std::size_t(i)] != 0) a.deviation_um[i] = std::numeric_limits<double>::quiet_NaN();
  return a;
}

/// Points of a map within half a step of a line through the middle of the part, in order along it.
render::ProfileSeries profile(const render::Field& field, const std::string& line, const std::string& name) {
  const auto& vertices = field.design.vertices;
  const Eigen::RowVector3d lower = vertices.colwise().minCoeff(), upper = vertices.colwise().maxCoeff();
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
  std::sort(points.begin(), points.end());
  render::ProfileSeries series;
  series.name = name;
  series.x_mm.resize(Eigen::Index(points.size()));
  series.y_um.resize(Eigen::Index(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    series.x_mm[Eigen::Index(i)] = points[i].first;
    series.y_um[Eigen::Index(i)] = points[i].second;
  }
  return series;
}

}  // namespace

void write_case_pictures(const std::filesystem::path& folder, const Job& job, const Verdict& verdict) {
  write_file(folder / "residual.vtp", [&](const std::filesystem::path& file) {
    render::write_residual(file, job.design_w, verdict.aligned.surface);
  });
  write_file(folder / "residual.png", [&](const std::filesystem::path& file) {
    render::MapPicture picture = map_picture(job, verdict);
    picture.title = job.scene.title + ": " + verdict.cut.name;
    render::MapOptions options;
    options.range_um = job.scene.view.range_um;
    options.from = job.scene.view.from;
    options.up = job.scene.view.up;
    render::write_map(file, picture, options);
  });
  write_file(folder / "histogram.png", [&](const std::filesystem::path& file) {
    render::HistogramOptions options;
    options.title = job.scene.title + ": " + verdict.cut.name;
    if (job.scene.part.tolerance > 0.0) options.tolerance_um = job.scene.part.tolerance / units::um;
    render::write_histogram(file, deviation_um(verdict), job.design_w.area, options);
  });
}

void write_comparison_picture(const std::filesystem::path& file, const Job& job,
                              const std::vector<Compared>& cases) {
  std::vector<render::MapPicture> pictures;
  for (const Compared& one : cases) {
    pictures.push_back(map_picture(job, one.verdict));
    const std::string text = reduction_text(one, cases);
    if (!text.empty()) pictures.back().caption.push_back(text);
  }
  render::ComparisonOptions options;
  options.title = job.scene.title;
  options.range_um = job.scene.view.range_um;
  options.from = job.scene.view.from;
  options.up = job.scene.view.up;
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_comparison(temporary, pictures, options);
  });
}

void write_check_picture(const std::filesystem::path& file, const Job& job) {
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::MachineOptions options;
    // a turned part is looked in the face
    if (job.machine.workpiece_spindle) options.from = Eigen::Vector3d(1.0, -0.8, 0.6);
    render::write_machine(temporary, check_scene(job), options);
  });
}

std::filesystem::path render_result(const RenderOptions& options) {
  const std::filesystem::path source = result_file(options.result);
  render::Field field = render::read_residual(source);
  std::string title = source.parent_path().filename().string();
  if (options.minus) {
    const std::filesystem::path other = result_file(*options.minus);
    field = difference(std::move(field), render::read_residual(other), other);
    title += " minus " + other.parent_path().filename().string();
  }
  const std::filesystem::path folder = options.out.empty() ? source.parent_path() : options.out;
  prepare_folder(folder);
  if (options.line) {
    render::ProfileOptions plot;
    plot.title = title;
    plot.x_label = *options.line + " / mm";
    const auto series = profile(field, *options.line, title);
    const std::filesystem::path drawn = folder / ("profile-" + *options.line + ".png");
    write_file(drawn, [&](const std::filesystem::path& file) { render::write_profile(file, {series}, plot); });
    return drawn;
  }
  render::MapPicture picture;
  picture.title = title;
  picture.figures = render::figures(field.deviation_um, field.design.area);
  picture.datum = picture.alignment = "as in the result";
  picture.field = std::move(field);
  const std::string name = options.minus ? "difference.png" : "residual.png";
  write_file(folder / name, [&](const std::filesystem::path& file) { render::write_map(file, picture, {}); });
  if (options.minus)
    write_file(folder / "difference.vtp",
               [&](const std::filesystem::path& file) { render::write_residual(file, picture.field); });
  return folder / name;
}

}  // namespace abbe::sim

#else

namespace abbe::sim {

void write_case_pictures(const std::filesystem::path&, const Job&, const Verdict&) {}
void write_comparison_picture(const std::filesystem::path&, const Job&, const std::vector<Compared>&) {}
void write_check_picture(const std::filesystem::path&, const Job&) {}
std::filesystem::path render_result(const RenderOptions& options) {
  throw BadInput(options.result.string(), 0, 0, "a program built with -DABBE_RENDER=ON", "one without VTK");
}

}  // namespace abbe::sim

#endif
