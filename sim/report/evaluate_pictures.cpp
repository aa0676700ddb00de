#include "sim/report/evaluate_pictures.h"

#include <algorithm>

#include <fmt/format.h>

#include "errors/metrology/shares.h"
#include "kinematics/units.h"
#include "sim/files/output.h"
#if ABBE_RENDER
#include "render/plot.h"
#endif

namespace abbe::sim {

namespace metrology = errors::metrology;

#if ABBE_RENDER
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t most_panels = 12;  // of one picture

double unit_of(bool angle) { return angle ? units::urad : units::um; }
const char* word_of(bool angle) { return angle ? "µrad" : "µm"; }

std::string figure(const char* name, const std::optional<double>& value, bool angle) {
  return value ? fmt::format("{} {:.2f} {}", name, *value / unit_of(angle), word_of(angle)) : "";
}

/// Mean of one way of approach with its band of 2 s, over the runs themselves.
void add_way(render::Panel& panel, const char* name, const VectorXd& target,
             const Eigen::MatrixXd& runs, const std::optional<metrology::OneWayPositioning>& way,
             double unit, int colour) {
  if (!way) return;
  render::Series mean{name, target, way->mean / unit, {}, {}, render::Mark::LineAndPoints, colour};
  if (way->s.size() > 0) {
    mean.lower = (way->mean - 2.0 * way->s) / unit;
    mean.upper = (way->mean + 2.0 * way->s) / unit;
  }
  panel.series.push_back(mean);
  VectorXd x(runs.size()), y(runs.size());
  for (Index k = 0; k < runs.cols(); ++k) {
    x.segment(k * runs.rows(), runs.rows()) = target;
    y.segment(k * runs.rows(), runs.rows()) = runs.col(k) / unit;
  }
  panel.series.push_back({"", x, y, {}, {}, render::Mark::Points, colour});
}

render::Panel panel_of(const std::string& name, const metrology::PositionRuns& runs, bool angle,
                       bool is_positioning, const std::string& x_label, double x_unit) {
  const metrology::Positioning p = metrology::positioning(runs);
  render::Panel panel{name, x_label, fmt::format("deviation / {}", word_of(angle)), {}, {}};
  const VectorXd target = runs.target / x_unit;
  add_way(panel, "up ± 2 s", target, runs.up, p.up, unit_of(angle), 0);
  add_way(panel, "down ± 2 s", target, runs.down, p.down, unit_of(angle), 1);
  if (is_positioning) panel.note = {figure("A", p.A, angle), figure("E", p.E, angle)};
  panel.note.push_back(figure("R", p.R, angle));
  panel.note.push_back(figure("B", p.B, angle));
  std::erase(panel.note, std::string());
  return panel;
}

/// Name of a test with what was taken out of it.
std::string title_of(const metrology::AxisTest& test) {
  if (test.what == metrology::AxisTest::What::Straightness) return test.name + ", less its line";
  if (test.what == metrology::AxisTest::What::ErrorMotion && !test.axial &&
      !hides_in_centring(test))
    return test.name + ", less order 1";
  return test.name;
}

std::vector<render::Panel> line_panels(const metrology::Tests& tests) {
  std::vector<render::Panel> panels;
  for (const metrology::AxisTest& test : tests.axes)
    panels.push_back(panel_of(title_of(test), form_of(test), test.angle,
                              test.what == metrology::AxisTest::What::Positioning,
                              fmt::format("{} / {}", test.axis, test.rotary ? "deg" : "mm"),
                              test.rotary ? units::deg : 1.0));
  for (const metrology::DiagonalTest& test : tests.diagonals)
    panels.push_back(
        panel_of(test.name, test.runs.runs, false, true, "along the diagonal / mm", 1.0));
  return panels;
}

/// A sense about a centre; one that goes all the way round ends where it began.
render::PolarTrace trace_of(const char* name, const metrology::CircularTrace& trace,
                            const metrology::CircularRuns& runs, const Eigen::Vector2d& centre) {
  VectorXd angle = trace.angle;
  VectorXd deviation = trace.radius.array() - runs.nominal_radius;
  for (Index i = 0; i < deviation.size(); ++i)
    deviation[i] -= centre.x() * std::cos(angle[i]) + centre.y() * std::sin(angle[i]);
  if (metrology::goes_round(angle)) {
    angle.conservativeResize(angle.size() + 1);
    deviation.conservativeResize(angle.size());
    angle.tail<1>() = angle.head<1>();
    deviation.tail<1>() = deviation.head<1>();
  }
  return {name, angle, deviation / units::um};
}

void write_circle(const std::filesystem::path& file, const metrology::CircleTest& test,
                  const std::string& from) {
  const metrology::Circular circle = metrology::circular(test.runs);
  std::vector<render::PolarTrace> traces;
  if (circle.anticlockwise)
    traces.push_back(trace_of("anticlockwise", test.runs.anticlockwise, test.runs, circle.centre));
  if (circle.clockwise)
    traces.push_back(trace_of("clockwise", test.runs.clockwise, test.runs, circle.centre));
  render::PolarOptions options;
  const bool least_squares = circle.centre_is == metrology::CircleCentre::LeastSquares;
  options.title = test.name + (least_squares ? ", about its least-squares centre"
                                             : ", about the centre as set up");
  options.first_axis = test.plane.substr(0, 1);
  options.second_axis = test.plane.substr(1, 1);
  const auto& all = circle.both            ? circle.both
                    : circle.anticlockwise ? circle.anticlockwise
                                           : circle.clockwise;
  options.caption = {from};
  options.note = {figure("G", all->G_lsq, false)};
  if (circle.H) options.note.push_back(figure("H", circle.H, false));
  if (test.zero_known) {
    options.note.push_back(figure("F max", all->F_max, false));
    options.note.push_back(figure("F min", all->F_min, false));
  }
  options.note.push_back(fmt::format("radius {:.1f} mm", test.runs.nominal_radius));
  render::write_polar(file, traces, options);
}

void write_drift(const std::filesystem::path& file, const metrology::DriftTest& test,
                 const std::string& from) {
  std::vector<render::Panel> panels;
  const VectorXd& time_s = test.log.time_s;
  const bool long_log = time_s[time_s.size() - 1] - time_s[0] > 7200.0;
  const VectorXd x = (time_s.array() - time_s[0]) / (long_log ? 3600.0 : 60.0);
  for (const bool angle : {false, true}) {
    render::Panel panel{angle ? "tilts" : "displacements",
                        long_log ? "time / h" : "time / min",
                        fmt::format("drift / {}", word_of(angle)),
                        {},
                        {}};
    for (std::size_t c = 0; c < test.log.names.size(); ++c)
      if (test.angle[c] == angle)
        panel.series.push_back(
            {test.log.names[c], x, test.log.values.col(Index(c)) / unit_of(angle), {}, {}});
    if (!panel.series.empty()) panels.push_back(std::move(panel));
  }
  render::CurvesOptions options;
  options.title = test.name;
  options.caption = {from};
  render::write_curves(file, panels, options);
}

/// A name of a set-up as part of a file's name.
std::string in_a_file_name(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '+') c = '_';
  return name;
}

}  // namespace

std::vector<std::filesystem::path> write_test_pictures(const ResultFolder& folder,
                                                       const metrology::Tests& tests,
                                                       const std::string& from) {
  std::vector<std::filesystem::path> files;
  const auto add = [&](const std::string& name, const auto& draw) {
    std::string file = name + ".png";
    for (int k = 2; std::find(files.begin(), files.end(), folder.path() / file) != files.end(); ++k)
      file = fmt::format("{}-{}.png", name, k);
    files.push_back(folder.path() / file);
    write_file(folder / file, [&](const std::filesystem::path& temporary) { draw(temporary); });
  };
  const std::vector<render::Panel> panels = line_panels(tests);
  for (std::size_t first = 0; first < panels.size(); first += most_panels) {
    const auto begin = panels.begin() + std::ptrdiff_t(first);
    const auto count = std::min(most_panels, panels.size() - first);
    add("axes", [&](const std::filesystem::path& file) {
      render::CurvesOptions options;
      options.title = "deviations over the commanded position; points: single readings";
      options.caption = {from, "actual minus target; a slide's count from its target nearest to 0"};
      options.columns = count > 3 ? 2 : 1;
      options.width = options.columns == 2 ? 2600 : 1600;
      render::write_curves(file, {begin, begin + std::ptrdiff_t(count)}, options);
    });
  }
  for (const metrology::CircleTest& test : tests.circles)
    add(in_a_file_name(test.name),
        [&](const std::filesystem::path& file) { write_circle(file, test, from); });
  for (const metrology::DriftTest& test : tests.drifts)
    add(in_a_file_name(test.name),
        [&](const std::filesystem::path& file) { write_drift(file, test, from); });
  return files;
}

std::vector<std::filesystem::path> write_part_picture(const ResultFolder& folder,
                                                      const PartReadingsFile& part,
                                                      const std::string& from) {
  const VectorXd deviation_um = part.readings.deviation / units::um;
  render::HistogramOptions options;
  options.title = part.part + ", read by " + part.instrument;
  options.caption = {from, "along the design's normals, + material left"};
  write_file(folder / "part.png", [&](const std::filesystem::path& file) {
    render::write_histogram(file, deviation_um, VectorXd::Ones(deviation_um.size()), options);
  });
  return {folder.path() / "part.png"};
}
#else
std::vector<std::filesystem::path> write_part_picture(const ResultFolder&, const PartReadingsFile&,
                                                      const std::string&) {
  return {};
}
std::vector<std::filesystem::path> write_test_pictures(const ResultFolder&, const metrology::Tests&,
                                                       const std::string&) {
  return {};
}
#endif

}  // namespace abbe::sim
