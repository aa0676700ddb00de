#include "sim/report/maps_page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/compensation/time_series.h"
#include "sim/cut/bodies.h"
#include "sim/report/page_data.h"
#include "sim/report/page_template.h"

namespace abbe::sim {

namespace {

using nlohmann::ordered_json;

constexpr double max_residual_step_um = 2e-3, min_residual_step_um = 1e-3;  // residual
constexpr int cut_time_step_ms = 20;
constexpr double ms = 1e-3;

/// Returns the step of a residual: 1 nm, or a two-thousandth of a map that spans less than 2 um; 2
/// nm if the map then fits into 16 bits.
double residual_step(const Eigen::VectorXd& residual_um) {
  const double step = step_for_16_bits(residual_um);  // a 65534th of the span
  if (step > max_residual_step_um) return min_residual_step_um;
  return std::max(step, std::min(min_residual_step_um, 32.0 * step));
}

/// A column from which others may be predicted.
struct Column {
  std::string name;
  double step = 0.0;  ///< 0: the numbers are the values
  Eigen::VectorXi numbers;
};

/// Data shared by all maps of a page.
struct SharedColumns {
  std::vector<Eigen::Index> order;  ///< old number of each vertex
  std::map<int, int> midst;         ///< of each line, in steps of cut_time_step_ms; or empty
  std::vector<Column> residual, form, line, time;  ///< of the maps so far
};

/// Packs the numbers of all vertices, predicted from one of `others` if that saves bytes.
void add_column(PageData& data, const Column& column, const std::vector<Column>& others) {
  std::vector<const Eigen::VectorXi*> references;
  std::vector<std::string> names;
  for (const Column& other : others) {
    if (other.step != column.step) continue;
    references.push_back(&other.numbers);
    names.push_back(other.name);
  }
  PackedColumns packed = pack_numbers(column.numbers, references);
  if (column.step > 0.0) {
    packed.step = {column.step};
    packed.offset = {0.0};
  }
  add(data, column.name, packed, names);
}

/// Returns a column in the order of the page's vertices, in steps.
Column quantized_column(const std::string& name, const Eigen::VectorXd& values, double step,
                        const SharedColumns& shared) {
  return {name, step, numbers_of(values(shared.order), step, {0.0})};
}

/// Returns the times at which the lines of the program are half done, for the first run of each;
/// the page computes the same table from the same numbers.
std::map<int, int> line_midpoint_times(PageData& data, const LineIntervals& stretches) {
  const auto& [line, begin_ms] = stretches;
  if (line.empty()) return {};
  std::map<int, int> midst;
  for (std::size_t k = 0; k < line.size(); ++k) {
    const int end_ms = begin_ms[std::min(k + 1, line.size() - 1)];
    midst.emplace(line[k], (begin_ms[k] + end_ms + cut_time_step_ms) / (2 * cut_time_step_ms));
  }
  const auto column = [&](const std::vector<int>& numbers) {
    return Eigen::Map<const Eigen::VectorXi>(numbers.data(), Eigen::Index(line.size()));
  };
  add(data, "block_line", pack_numbers(column(line)));
  PackedColumns times = pack_numbers(column(begin_ms));
  times.step = {ms};
  times.offset = {0.0};
  add(data, "block_time", times);
  return midst;
}

/// Adds line and time of cutting. The time is predicted from the middle of its line's run, which is
/// known to the page.
void add_times(PageData& data, const CaseMap& map, const std::string& number,
               SharedColumns& shared) {
  Column line{"line" + number, 0.0, Eigen::VectorXi(map.residual_um.size())};
  Column midst{"midst:" + line.name, cut_time_step_ms * ms, line.numbers};
  for (Eigen::Index k = 0; k < line.numbers.size(); ++k) {
    line.numbers[k] = map.cut_line[std::size_t(shared.order[std::size_t(k)])];
    const auto at = shared.midst.find(line.numbers[k]);
    midst.numbers[k] = at == shared.midst.end() ? 0 : at->second;
  }
  add_column(data, line, shared.line);
  shared.line.push_back(line);
  std::vector<Column> others = shared.time;
  if (!shared.midst.empty()) others.push_back(midst);
  const Column time = quantized_column("cut_time" + number, map.cut_time_s, midst.step, shared);
  add_column(data, time, others);
  shared.time.push_back(time);
}

/// Adds the layers of a case; each is predicted from the same layer of earlier cases, which differ
/// little.
void add_layers(PageData& data, const CaseMap& map, bool has_form, SharedColumns& shared) {
  const std::string number = std::to_string(data.index["cases"].size());
  const double step = residual_step(map.residual_um);
  const auto add_layer = [&](const std::string& name, const Eigen::VectorXd& values_um,
                             std::vector<Column>& earlier) {
    const Column layer = quantized_column(name + number, values_um, step, shared);
    add_column(data, layer, earlier);
    earlier.push_back(layer);
  };
  add_layer("residual", map.residual_um, shared.residual);
  if (has_form) add_layer("form", map.form_um, shared.form);
  add_times(data, map, number, shared);
  data.index["cases"].push_back(
      {{"name", map.name}, {"step_nm", 1e3 * step}, {"stats", map.shown}});
}

/// Adds the mesh, its vertices in the order of the page.
void add_mesh(PageData& data, const PartMaps& maps, const std::vector<Eigen::Index>& order) {
  data.index["vertices"] = maps.vertices.rows();
  data.index["triangles"] = maps.triangles.rows();
  add(data, "triangle", pack_numbers(sorted_triangles(maps.triangles, order)));
  const Eigen::MatrixXd vertices = maps.vertices(order, Eigen::all);
  add(data, "position", pack_values(vertices, step_for_16_bits(vertices)));
}

/// Adds the region of every vertex.
void add_regions(PageData& data, const PartMaps& maps, const std::vector<Eigen::Index>& order) {
  data.index["regions"] = maps.regions;
  if (maps.regions.empty()) return;
  const Eigen::Map<const Eigen::VectorXi> numbers(maps.region.data(),
                                                  Eigen::Index(maps.region.size()));
  add(data, "region", pack_numbers(numbers(order)));
}

/// Returns true if a design has the mesh of the page.
bool has_mesh(const PartMaps& maps, const cutting::Design& design) {
  // 1 nm is far above the rounding of a change of frame.
  return maps.vertices.rows() == design.vertices.rows() &&
         maps.triangles.rows() == design.triangles.rows() && maps.triangles == design.triangles &&
         (maps.vertices - design.vertices).cwiseAbs().maxCoeff() < 1e-6;
}

/// Returns true if all values can be packed with the step.
bool fits(const Eigen::VectorXd& values, double step) {
  return std::ranges::all_of(values, [&](double value) {
    return std::isnan(value) || std::abs(value) <= step * max_packed;
  });
}

}  // namespace

bool add_case(PartMaps& maps, const cutting::Design& design, CaseMap one) {
  if (maps.cases.empty()) {
    maps.vertices = design.vertices;
    maps.triangles = design.triangles;
  } else if (!has_mesh(maps, design)) {
    maps.left_out.push_back(fmt::format(
        "{} is in the table and not among the maps: its part is another mesh, of {} vertices, than "
        "that of {}, which the maps share",
        one.name, design.vertices.rows(), maps.cases.front().name));
    return false;
  }
  maps.cases.push_back(std::move(one));
  return true;
}

ordered_json displayed_figures(const ordered_json& figures) {
  const auto of = [&](const char* map, const char* key) {
    const ordered_json all = figures.value(map, ordered_json());
    const bool is_there = all.is_object() && all.contains(key) && all.at(key).is_number();
    return is_there ? fmt::format("{:.4g}", all.at(key).get<double>()) : std::string("–");
  };
  return {{"residual", "PV " + of("residual_um", "pv") + "  RMS " + of("residual_um", "rms")},
          {"form", "PV " + of("form_um", "pv") + "  RMS " + of("form_um", "rms")},
          {"texture", "Sz " + of("texture_um", "Sz") + "  Sq " + of("texture_um", "Sq")}};
}

std::optional<std::string> packing_limit(const CaseMap& one) {
  const double step = residual_step(one.residual_um);
  if (!fits(one.residual_um, step)) return "a deviation";
  if (!fits(one.form_um, step)) return "a form";
  if (!fits(one.cut_time_s, cut_time_step_ms * ms)) return "an instant of cutting";
  if (std::ranges::any_of(one.cut_line, [](int line) { return line < 0 || line > max_packed; }))
    return "a line of the program";
  return std::nullopt;
}

void add_maps(PageData& data, const PartMaps& maps) {
  SharedColumns shared{morton_order(maps.vertices), {}, {}, {}, {}, {}};
  add_mesh(data, maps, shared.order);
  add_regions(data, maps, shared.order);
  shared.midst = line_midpoint_times(data, maps.stretches);
  const bool has_form =
      std::ranges::all_of(maps.cases, [](const CaseMap& one) { return one.form_um.size() > 0; });
  for (const CaseMap& one : maps.cases) add_layers(data, one, has_form, shared);
}

namespace {

using compensation::TimeSeries;

// A hundredth of a mm or degree is below a pixel of the page.
constexpr double motion_tolerance = 0.01;  // mm and degrees
constexpr double motion_step = 1e-3;       // the same
constexpr double spindle_tolerance = 1.0;  // degrees
constexpr double time_step_s = 1e-3;
constexpr double body_step_mm = 0.01;
// A rotation is packed as the displacement at a radius of 1 m.
constexpr double track_fraction = 0.02, min_track_step = 5e-5;  // mm, and rad by the metre
constexpr double signal_fraction = 1.0 / 500.0;

/// Adds a body of the machine, except the part, which the map shows.
void add_body(PageData& data, const SolidBody& body, int tool) {
  if (body.kind == SolidBody::Kind::Part || body.mesh.vertices.rows() == 0) return;
  ordered_json& bodies = data.index["machine"]["bodies"];
  const bool is_machine = body.kind == SolidBody::Kind::Machine;
  const bool hides = is_machine && body.carrier != "b";
  const std::string number = std::to_string(bodies.size());
  add(data, "body" + number, pack_values(body.mesh.vertices, body_step_mm));
  add(data, "facet" + number, pack_numbers(body.mesh.triangles));
  bodies.push_back(
      {{"on", body.carrier == "w" ? "f" : body.carrier},
       {"tool", tool},  // -1: always present
       {"opacity", hides ? 0.35 : 1.0},
       {"colour", is_machine ? std::vector{0.62, 0.68, 0.76} : std::vector{0.45, 0.50, 0.55}}});
}

bool is_tool_body(const SolidBody& body) {
  return body.kind == SolidBody::Kind::Holder || body.kind == SolidBody::Kind::Shank ||
         body.kind == SolidBody::Kind::Cutter;
}

/// Adds the bodies of the machine and of every tool.
void add_bodies(PageData& data, const Job& job) {
  data.index["machine"]["bodies"] = ordered_json::array();
  const std::span<const Job> parts = parts_of(job);
  for (std::size_t tool = 0; tool < parts.size(); ++tool)
    for (const SolidBody& body : job_bodies(parts[tool]))
      if (is_tool_body(body))
        add_body(data, body, parts.size() > 1 ? int(tool) : -1);
      else if (tool == 0)
        add_body(data, body, -1);
}

/// Returns the commanded axes along the parts of a job, in mm and degrees.
TimeSeries motion_of(const Job& job) {
  Eigen::Index count = 0, row = 0;
  for (const Job& part : parts_of(job)) count += Eigen::Index(part.samples.states.size());
  const kinematics::Chain& chain = job.machine.nominal;
  TimeSeries course{Eigen::VectorXd(count), Eigen::MatrixXd(count, chain.size())};
  for (const Job& part : parts_of(job))
    for (const kinematics::AxisState& state : part.samples.states) {
      course.time_s[row] = state.time_s;
      for (int j = 0; j < chain.size(); ++j) {
        const bool turns = chain.joints()[std::size_t(j)].motion != kinematics::Motion::Linear;
        course.value(row, j) = state.q[j] * (turns ? 180.0 / std::numbers::pi : 1.0);
      }
      ++row;
    }
  return course;
}

/// Adds the motion of the axes, thinned to the tolerance of the page.
void add_motion(PageData& data, const Job& job) {
  const TimeSeries course = motion_of(job);
  Eigen::VectorXd tolerance = Eigen::VectorXd::Constant(course.value.cols(), motion_tolerance);
  for (int j = 0; j < int(tolerance.size()); ++j)
    if (is_spindle(job.machine, j)) tolerance[j] = spindle_tolerance;
  TimeSeries few = compensation::thinned(course, tolerance);
  // A spindle turns so far that it needs a coarser step.
  const Eigen::VectorXd coarser = tolerance / motion_tolerance;
  for (Eigen::Index j = 0; j < few.value.cols(); ++j) few.value.col(j) /= coarser[j];
  PackedColumns packed = pack_values(few.value, motion_step);
  for (Eigen::Index j = 0; j < few.value.cols(); ++j) {
    packed.step[std::size_t(j)] *= coarser[j];
    packed.offset[std::size_t(j)] *= coarser[j];
  }
  add(data, "q", packed);
  add(data, "t", pack_values(few.time_s, time_step_s));
}

/// Returns the tool changes with the poses of the tools.
ordered_json tools_of(const Job& job) {
  ordered_json tools = ordered_json::array();
  for (const Job& part : parts_of(job)) {
    if (part.samples.states.empty()) continue;
    const auto& number = part.scene.tool.number;
    tools.push_back({{"from", part.samples.states.front().time_s},
                     {"name", (number ? fmt::format("T{} ", *number) : "") + part.scene.tool.name},
                     {"T_bt_home", to_json(part.machine.nominal.T_bt_home())}});
  }
  return tools;
}

/// Adds a signal or a clearance by its name.
void add_signal(PageData& data, std::size_t number, const std::string& name,
                const Eigen::VectorXd& time_s, const Eigen::VectorXd& value) {
  if (time_s.size() < 2) return;
  const double span = value.maxCoeff() - value.minCoeff();
  if (!(span > 0.0) || !std::isfinite(span)) return;
  const TimeSeries few = compensation::thinned(
      TimeSeries{time_s, value}, Eigen::VectorXd::Constant(1, signal_fraction * span / 2.0));
  ordered_json& all = data.index["cases"][number]["signals"];
  const std::string key = fmt::format("signal{}_{}", number, all.size());
  add(data, "t:" + key, pack_values(few.time_s, time_step_s));
  add(data, key, pack_values(few.value, signal_fraction * span / 2.0));
  all.push_back({{"name", name}, {"key", key}});
}

/// Adds all signals of a case as functions of time.
void add_signals(PageData& data, const Signals& signals, std::size_t number) {
  const auto time = std::ranges::find(signals.columns, "time_s");
  if (time == signals.columns.end()) return;
  const Eigen::VectorXd time_s = signals.rows.col(time - signals.columns.begin());
  std::vector<Eigen::Index> rows;  // the history before the program is not on its slider
  for (Eigen::Index row = 0; row < time_s.size(); ++row)
    if (time_s[row] >= 0.0 && (rows.empty() || time_s[row] >= time_s[rows.back()]))
      rows.push_back(row);
  for (std::size_t c = 0; c < signals.columns.size(); ++c)
    if (signals.columns[c] != "time_s" && signals.columns[c] != "line")
      add_signal(data, number, signals.columns[c], time_s(rows),
                 signals.rows(rows, Eigen::Index(c)));
}

/// Adds the smallest clearance of every block as steps over time.
void add_clearance(PageData& data, const Collisions& collisions, std::size_t number) {
  std::vector<double> time, value;
  for (const BlockClearance& block : collisions.blocks) {
    if (block.pair < 0 || !std::isfinite(block.at_least)) continue;
    for (const double t : {block.place.time_s, block.end_s}) {
      time.push_back(t);
      value.push_back(block.at_least);
    }
  }
  const auto count = Eigen::Index(time.size());
  add_signal(data, number, "clearance_mm", Eigen::Map<const Eigen::VectorXd>(time.data(), count),
             Eigen::Map<const Eigen::VectorXd>(value.data(), count));
}

/// Adds the deviation of the tool along the program.
void add_track(PageData& data, const ToolTrack& track, std::size_t number) {
  TimeSeries course{track.time_s, Eigen::MatrixXd(track.time_s.size(), 6)};
  course.value << track.actual_tip - track.nominal_tip,
      track.actual_direction - track.nominal_direction;
  const auto largest = [&](Eigen::Index from) {
    return course.value.middleCols(from, 3).cwiseAbs().maxCoeff();
  };
  const double mm = std::max(min_track_step, track_fraction * largest(0)),
               rad = std::max(min_track_step * 1e-3, track_fraction * largest(3));
  Eigen::VectorXd tolerance(6);
  tolerance << mm, mm, mm, rad, rad, rad;
  const TimeSeries few = compensation::thinned(course, tolerance);
  const std::string key = fmt::format("track{}", number);
  add(data, "t:" + key, pack_values(few.time_s, time_step_s));
  add(data, key + "_tip", pack_values(few.value.leftCols(3), mm / 10.0));
  add(data, key + "_direction", pack_values(few.value.rightCols(3), rad / 10.0));
  data.index["cases"][number]["track"] = key;
}

}  // namespace

std::vector<std::string> add_machine(PageData& data, const Job& job) {
  std::size_t samples = 0;
  for (const Job& part : parts_of(job)) samples += part.samples.states.size();
  if (samples < 2)
    return {
        fmt::format("the motion of the machine is left out of the report: its program has {} "
                    "samples",
                    samples)};
  const kinematics::Chain& chain = job.machine.nominal;
  ordered_json joints = ordered_json::array();
  for (const kinematics::Joint& joint : chain.joints())
    joints.push_back({{"name", std::string(1, joint.name)},
                      {"rotary", joint.motion != kinematics::Motion::Linear},
                      {"spindle", is_spindle(job.machine, int(joints.size()))},
                      {"workpiece", joint.side == kinematics::Side::Workpiece},
                      {"direction", to_json(joint.direction_b)},
                      {"point", to_json(joint.point_b)}});
  data.index["machine"] = {{"joints", joints},
                           {"T_bf_home", to_json(chain.T_bw_home())},
                           {"T_bw_home", to_json(chain.T_bw_home() * job.scene.part.T_wm)},
                           {"tools", tools_of(job)}};
  add_motion(data, job);
  add_bodies(data, job);
  if (job.machine.workpiece_spindle)
    return {
        "where the tool really was is left out of the report: in the frame of a part that turns "
        "its deviation turns with it"};
  return {};
}

void add_case_time_series(PageData& data, const Compared& one, std::size_t number) {
  const Cut& cut = one.verdict.cut;
  data.index["cases"][number]["signals"] = ordered_json::array();
  if (cut.track && cut.track->time_s.size() > 1 && !one.job->machine.workpiece_spindle)
    add_track(data, in_part_frame(*cut.track, one.job->scene.part.T_wm), number);
  add_signals(data, cut.signals, number);
  if (cut.collisions) add_clearance(data, *cut.collisions, number);
}

namespace {

using namespace html;

/// Returns the table of figures of every case. The unrounded numbers of comparison.json are kept in
/// attributes beside the displayed ones.
std::string figures_table(const ordered_json& cases, const PageData& data) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::map<std::string, double> step_nm;
  for (const ordered_json& one : data.index["cases"])
    step_nm[one.at("name").get<std::string>()] = one.at("step_nm").get<double>();
  std::string text = "<table id=\"figures\"><caption data-label=\"figures\"></caption><thead><tr>" +
                     label("case", "th");
  for (const char* key : keys) text += label(key, "th");
  text += label("maps_uncut_percent", "th") + label("precision", "th") + "</tr></thead><tbody>";
  for (const ordered_json& one : cases) {
    const std::string name = one.at("name").get<std::string>();
    text += "<tr data-case=\"" + html_escaped(name) + "\"><td>" + html_escaped(name) + "</td>";
    for (const char* key : keys) {
      const ordered_json& value = one.at("residual_um").at(key);
      text += value.is_number() ? fmt::format("<td data-key=\"{}\" data-value=\"{}\">{:.4g}</td>",
                                              key, value.dump(), value.get<double>())
                                : std::string("<td>–</td>");
    }
    const ordered_json& uncut = one.at("uncut_percent");
    text += uncut.is_number() ? fmt::format("<td>{:.4g}</td>", uncut.get<double>())
                              : std::string("<td>–</td>");
    const auto step = step_nm.find(name);
    text +=
        "<td>" + (step == step_nm.end() ? "–" : fmt::format("{:.2g}", step->second)) + "</td></tr>";
  }
  return text + "</tbody></table>";
}

/// Returns the table of figures of every region by case; empty if the part has no regions.
std::string regions_table(const PageData& data) {
  const ordered_json& regions = data.index["regions"];
  if (regions.empty()) return "";
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs", "in"};
  std::string text =
      "<table id=\"regions\"><caption data-label=\"region_figures\"></caption><thead><tr>" +
      label("region", "th") + label("case", "th");
  for (const char* key : keys)
    text += label(std::string_view(key) == "in" ? "in_percent" : key, "th");
  text += "</tr></thead><tbody>";
  for (const ordered_json& region : regions)
    for (const auto& [name, figures] : region.at("figures").items()) {
      text += "<tr><td>" + html_escaped(region.at("name").get<std::string>()) + "</td><td>" +
              html_escaped(name) + "</td>";
      for (const char* key : keys)
        text += figures.at(key).is_number()
                    ? fmt::format("<td>{:.4g}</td>", figures.at(key).get<double>())
                    : std::string("<td>–</td>");
      text += "</tr>";
    }
  return text + "</tbody></table>";
}

}  // namespace

PageData maps_data(const PartMaps& maps, const ordered_json& tolerance_um) {
  PageData data{{{"cases", ordered_json::array()}, {"arrays", ordered_json::object()}}, {}};
  data.index["tolerance_um"] = tolerance_um;
  add_maps(data, maps);
  return data;
}

std::string page_html(const MapsPage& page) {
  const auto said = [&](std::string_view text) {
    return insert_labels(text, report_labels(), page.language);
  };
  return filled(said(viewer_page()),
                {{"language", page.language},
                 {"title", html_escaped(page.title)},
                 {"style", std::string(viewer_style())},
                 {"script", viewer_script()},
                 {"script_hash", script_hash(viewer_script())},
                 {"labels", in_script(labels_json(report_labels()))},
                 {"figures", said(figures_table(page.cases, page.data))},
                 {"regions", said(regions_table(page.data))},
                 {"pictures", page.pictures},
                 {"words", said(page.words)},
                 {"data", "<script type=\"application/json\" id=\"index\">" +
                              in_script(page.data.index) + "</script>\n" + page.data.blocks}});
}

}  // namespace abbe::sim
