#include "sim/report/pictures.h"

#if ABBE_RENDER

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cutting/turned_mesh.h"
#include "kinematics/units.h"
#include "render/comparison.h"
#include "render/field.h"
#include "render/figures.h"
#include "render/machine.h"
#include "render/map.h"
#include "render/plot.h"
#include "sim/files/output.h"
#include "sim/report/machine_picture.h"

namespace abbe::sim {
namespace {

double um(const std::optional<double>& value) {
  return value ? *value / units::um : std::numeric_limits<double>::quiet_NaN();
}

render::Figures figures(const cutting::Statistics& s) { return {um(s.pv), um(s.rms), um(s.mean)}; }

cutting::Design design_m(const Job& job) {
  return cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
}

/// The map in the part frame, so that the camera stands where the scene says, however the part is
/// clamped.
render::MapPicture map_picture(const Job& job, const Verdict& verdict) {
  render::MapPicture picture;
  picture.field = render::field(design_m(job), verdict.aligned.surface);
  picture.title = verdict.cut.name;
  picture.figures = figures(verdict.residual);
  picture.datum = name_of(job.scene.datum.kind);
  picture.alignment = name_of(job.scene.alignment);
  if (const program::Unreached& u = job.unreached; u.points > 0)
    picture.caption.push_back(
        fmt::format("not reached by the machine: {} of {} passes, parts of {}", u.passes,
                    u.all_passes, u.broken_passes));
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
  const double change = 100.0 * (*after->rms / *before->rms - 1.0);
  // a true minus: at a hyphen the line might break
  return fmt::format("machine {} RMS, {}{:.2f}%", length_text(*after->rms),
                     change < 0.0 ? "\u2212" : "+", std::abs(change));
}

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

/// A time as people say it: hours where it is long.
std::string time_text(double time_s) {
  return std::abs(time_s) >= 600.0 ? fmt::format("{:.4g} h", time_s / 3600.0)
                                   : fmt::format("{:.4g} s", time_s);
}

/// Temperatures of all nodes over history and program.
void write_temperatures(const std::filesystem::path& file, const Job& job) {
  const errors::ThermalRun& run = job.truth.heat->run;
  const double from = run.knots.front().time_s, to = run.knots.back().time_s;
  constexpr int points = 600;
  const double unit = to - from > 2 * 3600.0 ? 3600.0 : (to - from > 300.0 ? 60.0 : 1.0);
  std::vector<render::ProfileSeries> series;
  for (const errors::ThermalNode& node : run.network.nodes)
    series.push_back({node.name, Eigen::VectorXd(points), Eigen::VectorXd(points)});
  for (int i = 0; i < points; ++i) {
    const double time_s = from + (to - from) * i / (points - 1);
    const Eigen::VectorXd T_C = errors::temperatures(run, time_s);
    for (std::size_t k = 0; k < series.size(); ++k) {
      series[k].x[i] = time_s / unit;
      series[k].y[i] = T_C[Eigen::Index(k)];
    }
  }
  render::ProfileOptions options;
  options.title = job.scene.title + ": temperatures";
  options.x_label = unit == 3600.0 ? "time / h" : (unit == 60.0 ? "time / min" : "time / s");
  options.y_label = "temperature / °C";
  options.caption = {"time 0 is the start of the program"};
  render::write_profile(file, series, options);
}

/// An instant, and the temperatures then of all nodes on which an element depends.
std::string instant_text(const Truth::Heat& heat, int joint, const errors::ElementName& name,
                         double time_s) {
  std::set<int> nodes;
  const auto add = [&](const errors::ThermalFunction& function) {
    for (const auto& term : function.terms) {
      nodes.insert(term.node);
      if (term.minus) nodes.insert(*term.minus);
    }
  };
  for (const errors::ThermalModel::Bound& bound : heat.model.elements) {
    if (bound.joint != joint || bound.location || bound.component != name.component()) continue;
    add(bound.element.offset);
    add(bound.element.slope);
  }
  const Eigen::VectorXd T_C = errors::temperatures(heat.run, time_s);
  std::string text = time_text(time_s);
  const char* before = ": ";
  for (const int node : nodes) {
    text += fmt::format("{}{} {:.1f}", before, heat.run.network.nodes[std::size_t(node)].name,
                        T_C[node]);
    before = ", ";
  }
  return nodes.empty() ? text : text + " °C";
}

/// One element over its range or the travel of its axis, at several instants.
void write_element(const std::filesystem::path& file, const Job& job,
                   const ThermalDescription::Plot& plot) {
  const kinematics::Chain& chain = job.machine.nominal;
  auto found = chain.find(plot.element.axis);
  if (!found && plot.element.axis == 'S') found = chain.find('s');
  const int j = found.value();
  const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
  const bool slide = joint.motion == kinematics::Motion::Linear;
  const double turn = 2 * pi;
  const double widest = slide ? 2000.0 : turn;
  const double from = plot.range ? plot.range->front() : std::max(joint.min, -widest);
  const double to = plot.range ? plot.range->back() : std::min(joint.max, widest);
  constexpr int points = 400;
  std::vector<render::ProfileSeries> series;
  for (const double time_s : plot.time_s) {
    render::ProfileSeries one{instant_text(*job.truth.heat, j, plot.element, time_s),
                              Eigen::VectorXd(points), Eigen::VectorXd(points)};
    for (int i = 0; i < points; ++i) {
      kinematics::AxisState state;
      state.q = kinematics::AxisVector::Zero(chain.size());
      state.q[j] = from + (to - from) * i / (points - 1);
      state.time_s = time_s;
      one.x[i] = slide ? state.q[j] : state.q[j] / units::deg;
      try {
        const kinematics::JointDeviation d = deviations(job.truth, state).joints[std::size_t(j)];
        one.y[i] = (plot.element.location ? d.location : d.motion)[plot.element.component()] /
                   (plot.element.is_angle() ? units::urad : units::um);
      } catch (const std::out_of_range&) {  // beyond a table: the curve ends there
        one.y[i] = std::numeric_limits<double>::quiet_NaN();
      }
    }
    series.push_back(std::move(one));
  }
  render::ProfileOptions options;
  const std::string name = errors::to_string(plot.element);
  options.title = job.scene.title + ": " + name;
  options.x_label = fmt::format("{} / {}", plot.element.axis, slide ? "mm" : "°");
  options.y_label = fmt::format("{} / {}", name, plot.element.is_angle() ? "µrad" : "µm");
  options.caption = {
      "actual minus nominal, all sources, as commanded; time 0 is the start of the "
      "program"};
  render::write_profile(file, series, options);
}

const std::string element_ending = "-temperatures.png";

/// Pictures of elements that an earlier run left and this one does not draw.
void remove_older(const ResultFolder& folder, const std::set<std::string>& drawn) {
  std::vector<std::string> older;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path(), none)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(element_ending) && !drawn.contains(name)) older.push_back(name);
  }
  for (const std::string& name : older) remove_file(folder / name);
}

/// What the summary beside a result says of it, if there is one.
struct About {
  std::string title;
  std::string datum = "not known";
  std::string alignment = "not known";
};

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
  return known;
}

}  // namespace

bool draws_pictures() { return true; }

void write_case_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict) {
  write_file(folder / "residual.vtp", [&](const std::filesystem::path& file) {
    render::write_residual(file, design_m(job), verdict.aligned.surface);
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
    if (const cutting::Statistics& s = verdict.residual; s.uncut_vertices + s.gouged_vertices > 0)
      options.caption.push_back(
          fmt::format("left out: {} of {} judged vertices uncut, {} gouged deeper than the band",
                      s.uncut_vertices, s.cut_vertices + s.uncut_vertices + s.gouged_vertices,
                      s.gouged_vertices));
    render::write_histogram(file, deviation_um(verdict), job.design_w.area, options);
  });
}

void write_source_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict) {
  const Process& process = verdict.cut.process;
  if (process.stock || process.turned)
    write_file(folder / "stock.vtp", [&](const std::filesystem::path& file) {
      render::write_stock(file, process.stock ? cutting::stock_mesh(*process.stock)
                                              : cutting::stock_mesh(*process.turned));
    });
  else
    remove_file(folder / "stock.vtp");
  const bool heat = job.truth.heat && verdict.cut.case_name != "error_free";
  if (heat)
    write_file(folder / "temperatures.png",
               [&](const std::filesystem::path& file) { write_temperatures(file, job); });
  else
    remove_file(folder / "temperatures.png");
  std::set<std::string> drawn;
  if (heat)
    for (const ThermalDescription::Plot& plot : job.scene.thermal->plots) {
      const std::string name = errors::to_string(plot.element) + element_ending;
      drawn.insert(name);
      write_file(folder / name,
                 [&](const std::filesystem::path& file) { write_element(file, job, plot); });
    }
  remove_older(folder, drawn);
}

void write_comparison_picture(const ResultFile& file, const Scene& scene,
                              const std::vector<Compared>& cases) {
  std::vector<render::MapPicture> pictures;
  for (const Compared& one : cases) {
    pictures.push_back(map_picture(*one.job, one.verdict));
    const std::string text = reduction_text(one, cases);
    if (!text.empty()) pictures.back().caption.push_back(text);
  }
  render::ComparisonOptions options;
  options.title = scene.title;
  options.range_um = scene.view.range_um;
  options.from = scene.view.from;
  options.up = scene.view.up;
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_comparison(temporary, pictures, options);
  });
}

void write_check_picture(const ResultFile& file, const Job& job) {
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::MachineOptions options;
    // a turned part is looked in the face
    if (job.machine.workpiece_spindle) options.from = Eigen::Vector3d(1.0, -0.8, 0.6);
    render::write_machine(temporary, machine_picture(job), options);
  });
}

std::filesystem::path render_result(const RenderOptions& options) {
  const std::filesystem::path source = result_file(options.result);
  render::Field field = render::read_residual(source);
  About known = about(source);
  if (options.minus) {
    const std::filesystem::path other = result_file(*options.minus);
    field = difference(std::move(field), render::read_residual(other), other);
    known.title += ", minus " + about(other).title;
  }
  const render::Figures numbers = render::figures(field.deviation_um, field.design.area);
  Writer writer{options.permissions, {source, source.parent_path() / "summary.json"}, true};
  if (options.minus) writer.inputs.push_back(result_file(*options.minus));
  const ResultFolder folder(options.out.empty() ? source.parent_path() : options.out, writer);
  if (options.line) {
    render::ProfileOptions plot;
    plot.title = known.title;
    plot.x_label = *options.line + " / mm";
    plot.caption = {"+ material left, − gouged; along the outward design normal",
                    fmt::format("whole map: PV {:.4g} µm, RMS {:.4g} µm; datum {}, alignment {}",
                                numbers.pv_um, numbers.rms_um, known.datum, known.alignment)};
    const ResultFile drawn = folder / ("profile-" + *options.line + ".png");
    write_file(drawn, [&](const std::filesystem::path& file) {
      render::write_profile(file, profile(field, *options.line), plot);
    });
    return drawn.path();
  }
  render::MapPicture picture;
  picture.title = known.title;
  picture.figures = numbers;
  picture.datum = known.datum;
  picture.alignment = known.alignment;
  picture.field = std::move(field);
  // never the name of a picture that a run left there
  const ResultFile drawn = folder / (options.minus ? "difference.png" : "rendered.png");
  write_file(drawn,
             [&](const std::filesystem::path& file) { render::write_map(file, picture, {}); });
  if (options.minus)
    write_file(folder / "difference.vtp", [&](const std::filesystem::path& file) {
      render::write_residual(file, picture.field);
    });
  return drawn.path();
}

}  // namespace abbe::sim

#else

namespace abbe::sim {

bool draws_pictures() { return false; }

void write_case_pictures(const ResultFolder&, const Job&, const Verdict&) {}
void write_source_pictures(const ResultFolder&, const Job&, const Verdict&) {}
void write_comparison_picture(const ResultFile&, const Scene&, const std::vector<Compared>&) {}
void write_check_picture(const ResultFile& file, const Job&) {
  throw BadInput(file.path().string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "one without VTK");
}
std::filesystem::path render_result(const RenderOptions& options) {
  throw BadInput(options.result.string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "one without VTK");
}

}  // namespace abbe::sim

#endif
