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

constexpr double max_residual_step_um = 2e-3, min_residual_step_um = 1e-3;
constexpr int cut_time_step_ms = 20;
constexpr double ms = 1e-3;

/// Returns the step of a residual: 1/2048 of the span of the map, at most 1 nm, or up to 2 nm if
/// the map then fits into 16 bits.
double residual_step(const Eigen::VectorXd& residual_um) {
  const double step = step_for_16_bits(residual_um);  // 1/65534 of the span
  if (step > max_residual_step_um) return min_residual_step_um;
  return std::max(step, std::min(min_residual_step_um, 32.0 * step));
}

/// A packed column, from which later ones may be predicted.
struct Column {
  std::string name;
  double step = 0.0;  ///< value of one unit of `numbers`; 0: the numbers are the values
  Eigen::VectorXi numbers;
};

/// Data shared by all maps of a page.
struct SharedColumns {
  std::vector<Eigen::Index> order;                 ///< number in the design of each vertex
  std::map<int, int> line_midpoints;               ///< middle of the run of each line, in units of
                                                   ///< cut_time_step_ms; empty if not known
  std::vector<Column> residual, form, line, time;  ///< of the maps packed so far
};

/// Packs the numbers of all vertices, predicted from one of `references` if that saves bytes.
void add_column(PageData& data, const Column& column, const std::vector<Column>& references) {
  std::vector<const Eigen::VectorXi*> numbers;
  std::vector<std::string> names;
  for (const Column& reference : references) {
    if (reference.step != column.step) continue;
    numbers.push_back(&reference.numbers);
    names.push_back(reference.name);
  }
  PackedColumns packed = pack_numbers(column.numbers, numbers);
  if (column.step > 0.0) {
    packed.step = {column.step};
    packed.offset = {0.0};
  }
  add(data, column.name, packed, names);
}

/// Returns values as a column of whole steps, in the order of the page's vertices.
Column quantized_column(const std::string& name, const Eigen::VectorXd& values, double step,
                        const SharedColumns& shared) {
  return {name, step, numbers_of(values(shared.order), step, {0.0})};
}

/// Packs the time intervals of the lines. Returns the middle of the first run of each line, which
/// the page computes from the same numbers, so that both predict the same cutting times.
std::map<int, int> add_line_intervals(PageData& data, const LineIntervals& intervals) {
  const auto& [line, begin_ms] = intervals;
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

/// Adds line and time of cutting. The time is predicted from the middle of the line's run.
void add_times(PageData& data, const CaseMap& map, const std::string& number,
               SharedColumns& shared) {
  Column line{"line" + number, 0.0, Eigen::VectorXi(map.residual_um.size())};
  Column midpoint{"midst:" + line.name, cut_time_step_ms * ms, line.numbers};
  for (Eigen::Index k = 0; k < line.numbers.size(); ++k) {
    line.numbers[k] = map.cut_line[std::size_t(shared.order[std::size_t(k)])];
    const auto match = shared.line_midpoints.find(line.numbers[k]);
    midpoint.numbers[k] = match == shared.line_midpoints.end() ? 0 : match->second;
  }
  add_column(data, line, shared.line);
  shared.line.push_back(line);
  std::vector<Column> references = shared.time;
  if (!shared.line_midpoints.empty()) references.push_back(midpoint);
  const Column time = quantized_column("cut_time" + number, map.cut_time_s, midpoint.step, shared);
  add_column(data, time, references);
  shared.time.push_back(time);
}

/// Adds the layers of a case. Each is predicted from the same layer of earlier cases, since the
/// cases differ little.
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
      {{"name", map.name}, {"step_nm", 1e3 * step}, {"stats", map.figures}});
}

/// Adds the mesh. Its vertices are in the order of a space-filling curve, so that each is predicted
/// well from the preceding one.
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
  // 1 nm is far above the rounding of a frame transformation.
  return maps.vertices.rows() == design.vertices.rows() &&
         maps.triangles.rows() == design.triangles.rows() && maps.triangles == design.triangles &&
         (maps.vertices - design.vertices).cwiseAbs().maxCoeff() < 1e-6;
}

/// Returns true if all values can be packed with the step.
bool can_pack(const Eigen::VectorXd& values, double step) {
  return std::ranges::all_of(values, [&](double value) {
    return std::isnan(value) || std::abs(value) <= step * max_packed;
  });
}

}  // namespace

bool add_case(PartMaps& maps, const cutting::Design& design, CaseMap case_map) {
  if (maps.cases.empty()) {
    maps.vertices = design.vertices;
    maps.triangles = design.triangles;
  } else if (!has_mesh(maps, design)) {
    maps.omissions.push_back(
        fmt::format("{} is in the table but has no map: its part is a mesh of {} vertices that "
                    "differs from the mesh of {}, which all maps share",
                    case_map.name, design.vertices.rows(), maps.cases.front().name));
    return false;
  }
  maps.cases.push_back(std::move(case_map));
  return true;
}

ordered_json displayed_figures(const ordered_json& figures) {
  const auto text = [&](const char* map, const char* key) {
    const ordered_json layer = figures.value(map, ordered_json());
    const bool has_figure = layer.is_object() && layer.contains(key) && layer.at(key).is_number();
    return has_figure ? fmt::format("{:.4g}", layer.at(key).get<double>()) : std::string("–");
  };
  return {{"residual", "PV " + text("residual_um", "pv") + "  RMS " + text("residual_um", "rms")},
          {"form", "PV " + text("form_um", "pv") + "  RMS " + text("form_um", "rms")},
          {"texture", "Sz " + text("texture_um", "Sz") + "  Sq " + text("texture_um", "Sq")}};
}

std::optional<std::string> packing_limit(const CaseMap& case_map) {
  const double step = residual_step(case_map.residual_um);
  if (!can_pack(case_map.residual_um, step)) return "a deviation";
  if (!can_pack(case_map.form_um, step)) return "a form";
  if (!can_pack(case_map.cut_time_s, cut_time_step_ms * ms)) return "a time of cutting";
  if (std::ranges::any_of(case_map.cut_line,
                          [](int line) { return line < 0 || line > max_packed; }))
    return "a line of the program";
  return std::nullopt;
}

void add_maps(PageData& data, const PartMaps& maps) {
  SharedColumns shared{morton_order(maps.vertices), {}, {}, {}, {}, {}};
  add_mesh(data, maps, shared.order);
  add_regions(data, maps, shared.order);
  shared.line_midpoints = add_line_intervals(data, maps.line_intervals);
  const bool has_form = std::ranges::all_of(
      maps.cases, [](const CaseMap& case_map) { return case_map.form_um.size() > 0; });
  for (const CaseMap& case_map : maps.cases) add_layers(data, case_map, has_form, shared);
}

namespace {

using compensation::TimeSeries;

// A hundredth of a mm or degree is less than a pixel of the page.
constexpr double motion_tolerance = 0.01;  // mm and degrees
constexpr double motion_step = 1e-3;       // mm and degrees
constexpr double spindle_tolerance = 1.0;  // degrees
constexpr double time_step_s = 1e-3;
constexpr double body_step_mm = 0.01;
// The smallest step of a rotation is that of a displacement at a radius of 1 m.
constexpr double track_fraction = 0.02;
constexpr double min_track_step = 5e-5;  // mm
constexpr double signal_fraction = 1.0 / 500.0;

/// Adds a body of the machine or a tool. The part is left out, since the map shows it.
void add_body(PageData& data, const SolidBody& body, int tool) {
  if (body.kind == SolidBody::Kind::Part || body.mesh.vertices.rows() == 0) return;
  ordered_json& bodies = data.index["machine"]["bodies"];
  const bool is_machine = body.kind == SolidBody::Kind::Machine;
  const bool is_covering = is_machine && body.carrier != "b";
  const std::string number = std::to_string(bodies.size());
  add(data, "body" + number, pack_values(body.mesh.vertices, body_step_mm));
  add(data, "facet" + number, pack_numbers(body.mesh.triangles));
  bodies.push_back(
      {{"on", body.carrier == "w" ? "f" : body.carrier},
       {"tool", tool},  // -1: drawn with every tool
       {"opacity", is_covering ? 0.35 : 1.0},
       {"colour", is_machine ? std::vector{0.62, 0.68, 0.76} : std::vector{0.45, 0.50, 0.55}}});
}

bool is_tool_body(const SolidBody& body) {
  return body.kind == SolidBody::Kind::Holder || body.kind == SolidBody::Kind::Shank ||
         body.kind == SolidBody::Kind::Cutter;
}

/// Adds the bodies of the machine and of every tool.
void add_bodies(PageData& data, const Job& job) {
  data.index["machine"]["bodies"] = ordered_json::array();
  const std::span<const Segment> segments = job_segments(job);
  for (std::size_t tool = 0; tool < segments.size(); ++tool)
    for (const SolidBody& body : segment_bodies(job, segments[tool]))
      if (is_tool_body(body))
        add_body(data, body, segments.size() > 1 ? int(tool) : -1);
      else if (tool == 0)
        add_body(data, body, -1);
}

/// Returns the commanded axis positions along a job, in mm and degrees.
TimeSeries axis_motion(const Job& job) {
  Eigen::Index count = 0, row = 0;
  for (const Segment& segment : job_segments(job))
    count += Eigen::Index(segment.samples.states.size());
  const kinematics::Chain& chain = job.machine.nominal;
  TimeSeries series{Eigen::VectorXd(count), Eigen::MatrixXd(count, chain.size())};
  for (const Segment& segment : job_segments(job))
    for (const kinematics::AxisState& state : segment.samples.states) {
      series.time_s[row] = state.time_s;
      for (int j = 0; j < chain.size(); ++j) {
        const bool is_rotary = chain.joints()[std::size_t(j)].motion != kinematics::Motion::Linear;
        series.value(row, j) = state.q[j] * (is_rotary ? 180.0 / std::numbers::pi : 1.0);
      }
      ++row;
    }
  return series;
}

/// Adds the motion of the axes, thinned to within `motion_tolerance`.
void add_motion(PageData& data, const Job& job) {
  const TimeSeries motion = axis_motion(job);
  Eigen::VectorXd tolerance = Eigen::VectorXd::Constant(motion.value.cols(), motion_tolerance);
  for (int j = 0; j < int(tolerance.size()); ++j)
    if (is_spindle(job.machine, j)) tolerance[j] = spindle_tolerance;
  TimeSeries thinned_motion = compensation::thin_out(motion, tolerance);
  // A spindle makes thousands of turns, for which the step of the axes is too fine to be packed.
  const Eigen::VectorXd step_ratio = tolerance / motion_tolerance;
  for (Eigen::Index j = 0; j < thinned_motion.value.cols(); ++j)
    thinned_motion.value.col(j) /= step_ratio[j];
  PackedColumns packed = pack_values(thinned_motion.value, motion_step);
  for (Eigen::Index j = 0; j < thinned_motion.value.cols(); ++j) {
    packed.step[std::size_t(j)] *= step_ratio[j];
    packed.offset[std::size_t(j)] *= step_ratio[j];
  }
  add(data, "q", packed);
  add(data, "t", pack_values(thinned_motion.time_s, time_step_s));
}

/// Returns the tools with the time of their change and their pose at the home position.
ordered_json tools_json(const Job& job) {
  ordered_json tools = ordered_json::array();
  for (const Segment& segment : job_segments(job)) {
    if (segment.samples.states.empty()) continue;
    const auto& number = segment.scene.tool.number;
    tools.push_back(
        {{"from", segment.samples.states.front().time_s},
         {"name", (number ? fmt::format("T{} ", *number) : "") + segment.scene.tool.name},
         {"T_bt_home", to_json(segment.machine.nominal.T_bt_home())}});
  }
  return tools;
}

/// Adds a signal or a clearance under its name; a constant or infinite one is left out.
void add_signal(PageData& data, std::size_t number, const std::string& name,
                const Eigen::VectorXd& time_s, const Eigen::VectorXd& value) {
  if (time_s.size() < 2) return;
  const double span = value.maxCoeff() - value.minCoeff();
  if (!(span > 0.0) || !std::isfinite(span)) return;
  const TimeSeries thinned_signal = compensation::thin_out(
      TimeSeries{time_s, value}, Eigen::VectorXd::Constant(1, signal_fraction * span / 2.0));
  ordered_json& signals = data.index["cases"][number]["signals"];
  const std::string key = fmt::format("signal{}_{}", number, signals.size());
  add(data, "t:" + key, pack_values(thinned_signal.time_s, time_step_s));
  add(data, key, pack_values(thinned_signal.value, signal_fraction * span / 2.0));
  signals.push_back({{"name", name}, {"key", key}});
}

/// Adds all signals of a case as functions of time.
void add_signals(PageData& data, const Signals& signals, std::size_t number) {
  const auto time = std::ranges::find(signals.columns, "time_s");
  if (time == signals.columns.end()) return;
  const Eigen::VectorXd time_s = signals.rows.col(time - signals.columns.begin());
  // The time slider of the page begins with the program, so the history before it is left out.
  std::vector<Eigen::Index> rows;
  for (Eigen::Index row = 0; row < time_s.size(); ++row)
    if (time_s[row] >= 0.0 && (rows.empty() || time_s[row] >= time_s[rows.back()]))
      rows.push_back(row);
  for (std::size_t c = 0; c < signals.columns.size(); ++c)
    if (signals.columns[c] != "time_s" && signals.columns[c] != "line")
      add_signal(data, number, signals.columns[c], time_s(rows),
                 signals.rows(rows, Eigen::Index(c)));
}

/// Adds the smallest clearance of every block as a step function of time.
void add_clearance(PageData& data, const Collisions& collisions, std::size_t number) {
  std::vector<double> time, value;
  for (const BlockClearance& block : collisions.blocks) {
    if (block.pair < 0 || !std::isfinite(block.min_clearance)) continue;
    for (const double t : {block.place.time_s, block.end_s}) {
      time.push_back(t);
      value.push_back(block.min_clearance);
    }
  }
  const auto count = Eigen::Index(time.size());
  add_signal(data, number, "clearance_mm", Eigen::Map<const Eigen::VectorXd>(time.data(), count),
             Eigen::Map<const Eigen::VectorXd>(value.data(), count));
}

/// Adds the deviation of the tool along the program.
void add_track(PageData& data, const ToolTrack& track, std::size_t number) {
  TimeSeries deviation{track.time_s, Eigen::MatrixXd(track.time_s.size(), 6)};
  deviation.value << track.actual_tip - track.nominal_tip,
      track.actual_direction - track.nominal_direction;
  const auto max_abs = [&](Eigen::Index from) {
    return deviation.value.middleCols(from, 3).cwiseAbs().maxCoeff();
  };
  const double tip_tolerance = std::max(min_track_step, track_fraction * max_abs(0)),
               direction_tolerance = std::max(min_track_step * 1e-3, track_fraction * max_abs(3));
  Eigen::VectorXd tolerance(6);
  tolerance << Eigen::Vector3d::Constant(tip_tolerance),
      Eigen::Vector3d::Constant(direction_tolerance);
  const TimeSeries thinned_deviation = compensation::thin_out(deviation, tolerance);
  const std::string key = fmt::format("track{}", number);
  add(data, "t:" + key, pack_values(thinned_deviation.time_s, time_step_s));
  add(data, key + "_tip", pack_values(thinned_deviation.value.leftCols(3), tip_tolerance / 10.0));
  add(data, key + "_direction",
      pack_values(thinned_deviation.value.rightCols(3), direction_tolerance / 10.0));
  data.index["cases"][number]["track"] = key;
}

}  // namespace

std::vector<std::string> add_machine(PageData& data, const Job& job) {
  std::size_t sample_count = 0;
  for (const Segment& segment : job_segments(job)) sample_count += segment.samples.states.size();
  if (sample_count < 2)
    return {fmt::format(
        "the motion of the machine is omitted from the report: its program has {} samples",
        sample_count)};
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
                           {"tools", tools_json(job)}};
  add_motion(data, job);
  add_bodies(data, job);
  if (job.machine.workpiece_spindle)
    return {
        "the actual path of the tool is omitted from the report: in the frame of a rotating part "
        "its deviation rotates with the part"};
  return {};
}

void add_case_time_series(PageData& data, const ComparedCase& compared, std::size_t number) {
  const Cut& cut = compared.verdict.cut;
  data.index["cases"][number]["signals"] = ordered_json::array();
  if (cut.track && cut.track->time_s.size() > 1 && !compared.job->machine.workpiece_spindle)
    add_track(data, in_part_frame(*cut.track, compared.job->scene.part.T_wm), number);
  add_signals(data, cut.signals, number);
  if (cut.collisions) add_clearance(data, *cut.collisions, number);
}

namespace {

using namespace html;

/// Returns the table of the figures of every case. Attributes of its cells hold the unrounded
/// numbers of comparison.json.
std::string figures_table(const ordered_json& cases, const PageData& data) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::map<std::string, double> step_nm;
  for (const ordered_json& entry : data.index["cases"])
    step_nm[entry.at("name").get<std::string>()] = entry.at("step_nm").get<double>();
  std::string text = "<table id=\"figures\"><caption data-label=\"figures\"></caption><thead><tr>" +
                     label("case", "th");
  for (const char* key : keys) text += label(key, "th");
  text += label("maps_uncut_percent", "th") + label("precision", "th") + "</tr></thead><tbody>";
  for (const ordered_json& case_figures : cases) {
    const std::string name = case_figures.at("name").get<std::string>();
    text += "<tr data-case=\"" + html_escaped(name) + "\"><td>" + html_escaped(name) + "</td>";
    for (const char* key : keys) {
      const ordered_json& value = case_figures.at("residual_um").at(key);
      text += value.is_number() ? fmt::format("<td data-key=\"{}\" data-value=\"{}\">{:.4g}</td>",
                                              key, value.dump(), value.get<double>())
                                : std::string("<td>–</td>");
    }
    const ordered_json& uncut = case_figures.at("uncut_percent");
    text += uncut.is_number() ? fmt::format("<td>{:.4g}</td>", uncut.get<double>())
                              : std::string("<td>–</td>");
    const auto step = step_nm.find(name);
    text +=
        "<td>" + (step == step_nm.end() ? "–" : fmt::format("{:.2g}", step->second)) + "</td></tr>";
  }
  return text + "</tbody></table>";
}

/// Returns the table of the figures of every region and case; empty if the part has no regions.
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
  const auto with_labels = [&](std::string_view text) {
    return insert_labels(text, report_labels(), page.language);
  };
  return filled(with_labels(viewer_page()),
                {{"language", page.language},
                 {"title", html_escaped(page.title)},
                 {"style", std::string(viewer_style())},
                 {"script", viewer_script()},
                 {"script_hash", script_hash(viewer_script())},
                 {"labels", in_script(labels_json(report_labels()))},
                 {"figures", with_labels(figures_table(page.cases, page.data))},
                 {"regions", with_labels(regions_table(page.data))},
                 {"pictures", page.pictures},
                 {"words", with_labels(page.details)},
                 {"data", "<script type=\"application/json\" id=\"index\">" +
                              in_script(page.data.index) + "</script>\n" + page.data.blocks}});
}

}  // namespace abbe::sim
