#include "sim/report/html_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "sim/compensation/course.h"
#include "sim/cut/bodies.h"
#include "sim/files/versions.h"
#include "sim/report/encode.h"
#include "sim/report/html_text.h"
#include "sim/report/report_labels.h"
#include "sim/report/result_map.h"
#include "sim/report/summary_report.h"
#include "sim/report/viewer_source.h"

namespace abbe::sim {
namespace {

using namespace html;
using nlohmann::ordered_json;

constexpr double coarsest_um = 2e-3, finest_um = 1e-3;  // residual
constexpr double motion_tolerance = 0.01;               // mm and degrees
constexpr double motion_step = 1e-3;                    // the same
constexpr double time_step_s = 1e-3, cut_time_step_s = 0.02;
constexpr double body_step_mm = 0.01;

/// What a page holds besides words: the index of its arrays, and their texts.
struct Data {
  ordered_json index;
  std::string blocks;
};

void add(Data& data, const std::string& name, const Packed& packed, bool delta = true) {
  ordered_json about{
      {"type", packed.type}, {"n", packed.rows}, {"components", packed.columns}, {"delta", delta}};
  if (!packed.step.empty()) {
    about["offset"] = packed.offset;
    about["step"] = packed.step;
  }
  data.index["arrays"][name] = about;
  data.blocks += "<script type=\"text/plain\" id=\"a:" + name + "\">" + packed.text + "</script>\n";
}

/// Names and values of a rigid pose, column after column.
ordered_json to_json(const kinematics::Pose& T) {
  const Eigen::Matrix4d m = T.matrix();
  return std::vector<double>(m.data(), m.data() + m.size());
}

ordered_json to_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// --- the part

/// 1 nm, or a two-thousandth of a map that spans less than 2 um; 2 nm where that saves 16 bits.
double residual_step(const Eigen::VectorXd& residual_um) {
  const double step = step_of_16_bits(residual_um);  // a 65534th of what it spans
  if (step > coarsest_um) return finest_um;
  return std::max(step, std::min(finest_um, 32.0 * step));
}

/// What all maps of a page share.
struct Shared {
  std::vector<Eigen::Index> order;  ///< of the vertices
  std::vector<int> line;            ///< of the first map, from which those of the others differ
  Eigen::VectorXd time_s;           ///< the same, 0 where nothing was removed
};

/// Differences of both signs as numbers: 0, -1, 1, -2, 2 ...
Eigen::MatrixXi zigzag(const std::vector<int>& numbers, const std::vector<int>& from) {
  Eigen::MatrixXi all(Eigen::Index(numbers.size()), 1);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const int difference = numbers[i] - from[i];
    all(Eigen::Index(i), 0) = difference < 0 ? -2 * difference - 1 : 2 * difference;
  }
  return all;
}

void add_case(Data& data, const ResultMap& map, const ordered_json& figures, Shared& shared) {
  const std::string number = std::to_string(data.index["cases"].size());
  const double step = residual_step(map.residual_um);
  add(data, "residual" + number, packed_values(map.residual_um(shared.order), step));
  std::vector<int> line;
  for (const Eigen::Index k : shared.order) line.push_back(map.cut_line[std::size_t(k)]);
  Eigen::VectorXd time_s = map.cut_time_s(shared.order);
  const bool is_first = shared.line.empty();
  if (is_first) {
    shared.line.assign(line.size(), 0);
    shared.time_s = Eigen::VectorXd::Zero(time_s.size());
  }
  add(data, "line" + number, packed_numbers(zigzag(line, shared.line)));
  add(data, "cut_time" + number, packed_values(time_s - shared.time_s, cut_time_step_s));
  if (is_first) {
    shared.line = line;
    shared.time_s = time_s.unaryExpr([](double t) { return std::isnan(t) ? 0.0 : t; });
  }
  const auto shown = [&](const char* key) {
    const ordered_json& value = figures.at("residual_um").at(key);
    return value.is_number() ? fmt::format("{:.4g}", value.get<double>()) : std::string("–");
  };
  data.index["cases"].push_back({{"name", map.facts.case_name},
                                 {"step_nm", 1e3 * step},
                                 {"stats", {{"pv", shown("pv")}, {"rms", shown("rms")}}}});
}

/// Corners by their new numbers, the least first, the two others less it; triangles by that one.
Eigen::MatrixXi ordered_triangles(const Eigen::MatrixXi& triangles,
                                  const std::vector<Eigen::Index>& order) {
  std::vector<int> number(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) number[std::size_t(order[k])] = int(k);
  std::vector<std::array<int, 3>> all;
  for (const auto& row : triangles.rowwise()) {
    std::array<int, 3> one{number[std::size_t(row[0])], number[std::size_t(row[1])],
                           number[std::size_t(row[2])]};
    std::ranges::rotate(one, std::ranges::min_element(one));
    all.push_back({one[0], one[1] - one[0], one[2] - one[0]});
  }
  std::ranges::sort(all);
  Eigen::MatrixXi sorted(Eigen::Index(all.size()), 3);
  for (Eigen::Index k = 0; k < sorted.rows(); ++k)
    sorted.row(k) << all[std::size_t(k)][0], all[std::size_t(k)][1], all[std::size_t(k)][2];
  return sorted;
}

void add_mesh(Data& data, const cutting::Design& design, const std::vector<Eigen::Index>& order) {
  data.index["vertices"] = design.vertices.rows();
  data.index["triangles"] = design.triangles.rows();
  const Eigen::MatrixXd vertices = design.vertices(order, Eigen::all);
  add(data, "position", packed_values(vertices, step_of_16_bits(vertices)));
  add(data, "triangle", packed_numbers(ordered_triangles(design.triangles, order)));
}

bool is_same_mesh(const cutting::Design& a, const cutting::Design& b) {
  return a.vertices.rows() == b.vertices.rows() && a.triangles.rows() == b.triangles.rows() &&
         a.triangles == b.triangles && (a.vertices - b.vertices).cwiseAbs().maxCoeff() < 1e-6;
}

// --- the machine

void add_bodies(Data& data, const Job& job) {
  ordered_json& machine = data.index["machine"];
  machine["bodies"] = ordered_json::array();
  for (const SolidBody& body : bodies_of(job)) {
    if (body.kind == SolidBody::Kind::Part || body.mesh.vertices.rows() == 0) continue;
    const bool is_machine = body.kind == SolidBody::Kind::Machine;
    const bool hides = is_machine && body.carrier != "b";
    const std::string number = std::to_string(machine["bodies"].size());
    add(data, "body" + number, packed_values(body.mesh.vertices, body_step_mm));
    add(data, "facet" + number, packed_numbers(body.mesh.triangles));
    machine["bodies"].push_back(
        {{"on", body.carrier == "w" ? "f" : body.carrier},
         {"opacity", hides ? 0.35 : 1.0},
         {"colour", is_machine ? std::vector{0.62, 0.68, 0.76} : std::vector{0.45, 0.50, 0.55}}});
  }
}

/// Where each line of the program begins.
void add_lines(Data& data, const program::Samples& samples) {
  std::vector<int> line;
  std::vector<double> time;
  for (std::size_t k = 0; k < samples.line.size(); ++k) {
    if (k > 0 && samples.line[k] == samples.line[k - 1]) continue;
    line.push_back(samples.line[k]);
    time.push_back(
        samples.states[k > 0 ? k - 1 : 0].time_s);  // a sample belongs to what ends there
  }
  const auto count = Eigen::Index(line.size());
  add(data, "block_line", packed_numbers(Eigen::Map<const Eigen::VectorXi>(line.data(), count)));
  add(data, "block_time",
      packed_values(Eigen::Map<const Eigen::VectorXd>(time.data(), count), time_step_s));
}

void add_motion(Data& data, const Job& job) {
  const kinematics::Chain& chain = job.machine.nominal;
  const auto& states = job.samples.states;
  compensation::Course course{Eigen::VectorXd(Eigen::Index(states.size())),
                              Eigen::MatrixXd(Eigen::Index(states.size()), chain.size())};
  auto& [time, q] = course;
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    time[k] = states[std::size_t(k)].time_s;
    for (int j = 0; j < chain.size(); ++j) {
      const bool turns = chain.joints()[std::size_t(j)].motion != kinematics::Motion::Linear;
      q(k, j) = is_spindle(job.machine, j)
                    ? 0.0
                    : states[std::size_t(k)].q[j] * (turns ? 180.0 / std::numbers::pi : 1.0);
    }
  }
  const compensation::Course few =
      compensation::thinned(course, Eigen::VectorXd::Constant(chain.size(), motion_tolerance));
  add(data, "q", packed_values(few.value, motion_step));
  add(data, "t", packed_values(few.time_s, time_step_s));
}

void add_machine(Data& data, const Job& job) {
  const kinematics::Chain& chain = job.machine.nominal;
  ordered_json joints = ordered_json::array();
  for (const kinematics::Joint& joint : chain.joints())
    joints.push_back({{"name", std::string(1, joint.name)},
                      {"rotary", joint.motion != kinematics::Motion::Linear},
                      {"fixed", is_spindle(job.machine, int(joints.size()))},
                      {"workpiece", joint.side == kinematics::Side::Workpiece},
                      {"direction", to_json(joint.direction_b)},
                      {"point", to_json(joint.point_b)}});
  data.index["machine"] = {{"joints", joints},
                           {"T_bf_home", to_json(chain.T_bw_home())},
                           {"T_bw_home", to_json(chain.T_bw_home() * job.scene.part.T_wm)},
                           {"T_bt_home", to_json(chain.T_bt_home())}};
  add_motion(data, job);
  add_lines(data, job.samples);
  add_bodies(data, job);
}

// --- the words

std::string plain(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "–" : value.dump();
}

/// The figures of every case from the numbers of comparison.json, which stand whole beside those
/// that are seen.
std::string figures_table(const ordered_json& json, const Data& data) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::map<std::string, double> step_nm;
  for (const ordered_json& one : data.index["cases"])
    step_nm[one.at("name").get<std::string>()] = one.at("step_nm").get<double>();
  std::string text = "<table id=\"figures\"><caption data-label=\"figures\"></caption><thead><tr>" +
                     label("case", "th");
  for (const char* key : keys) text += label(key, "th");
  text += label("precision", "th") + "</tr></thead><tbody>";
  for (const ordered_json& one : json.at("cases")) {
    const std::string name = one.at("name").get<std::string>();
    text += "<tr data-case=\"" + in_html(name) + "\"><td>" + in_html(name) + "</td>";
    for (const char* key : keys) {
      const ordered_json& value = one.at("residual_um").at(key);
      text += value.is_number() ? fmt::format("<td data-key=\"{}\" data-value=\"{}\">{:.4g}</td>",
                                              key, value.dump(), value.get<double>())
                                : std::string("<td>–</td>");
    }
    const auto step = step_nm.find(name);
    text +=
        "<td>" + (step == step_nm.end() ? "–" : fmt::format("{:.2g}", step->second)) + "</td></tr>";
  }
  return text + "</tbody></table>";
}

std::string verdicts(const std::vector<Compared>& cases) {
  std::vector<std::string> lines;
  for (const Compared& one : cases) {
    const std::string verdict =
        tolerance_verdict(one.verdict.residual.conformance, one.verdict.worst);
    if (!verdict.empty()) lines.push_back(one.verdict.cut.name + ": " + verdict);
    for (const std::string& limit : exceeded(one.job->scene.limits, one.verdict))
      lines.push_back(limit);
  }
  return list(lines);
}

std::string machine_words(const Job& job) {
  std::vector<std::string> lines;
  for (const kinematics::Joint& joint : job.machine.nominal.joints()) {
    const Eigen::Vector3d& u = joint.direction_b;
    const Eigen::Vector3d& p = joint.point_b;
    lines.push_back(fmt::format("{}{}: ({:.6g}, {:.6g}, {:.6g}), ({:.6g}, {:.6g}, {:.6g}) mm",
                                joint.name, joint.side == kinematics::Side::Workpiece ? "'" : "",
                                u.x(), u.y(), u.z(), p.x(), p.y(), p.z()));
  }
  return list(lines);
}

std::string words(const std::vector<Compared>& cases, const ordered_json& json,
                  const std::vector<std::string>& left_out, const HtmlAsked& asked) {
  const Job& job = *cases.front().job;
  std::string text = label("asked", "h2") + "<dl>";
  for (const char* key :
       {"scene", "seed", "vertices", "moves", "datum", "alignment", "tolerance_um"})
    text += row(key, plain(json.at(key)));
  text += row("program", job.path.file) +
          row("duration",
              fmt::format("{:.1f}",
                          job.samples.states.empty() ? 0.0 : job.samples.states.back().time_s)) +
          "</dl>" + label("machine_axes", "h2") + machine_words(job) + label("verdicts", "h2") +
          verdicts(cases);
  std::vector<std::string> warnings = json.at("warnings").get<std::vector<std::string>>();
  warnings.insert(warnings.end(), left_out.begin(), left_out.end());
  text += label("warnings", "h2") + list(warnings);
  if (json.contains("failed")) {
    std::vector<std::string> failed;
    for (const ordered_json& one : json.at("failed"))
      failed.push_back(plain(one.at("name")) + ": " + plain(one.at("reason")));
    text += label("failed", "h2") + list(failed);
  }
  text += label("versions", "h2") + "<dl>";
  for (const auto& [name, version] : json.at("versions").items())
    text += "<dt>" + in_html(name) + "</dt><dd>" + in_html(plain(version)) + "</dd>";
  return text + "</dl>" + label("repeat", "h2") + "<p><code>" + in_html(asked.command) +
         "</code></p><p><a download=\"scene.toml\" href=\"data:application/toml;base64," +
         base64(job.scene.resolved) + "\">scene.toml</a> " + label("download") + "</p>";
}

}  // namespace

HtmlReport html_report(const std::vector<Compared>& cases, const Comparison& comparison,
                       const HtmlAsked& asked) {
  const Job& job = *cases.front().job;
  const ordered_json json = to_json(comparison);
  HtmlReport report;
  Data data{{{"cases", ordered_json::array()}, {"arrays", ordered_json::object()}}, {}};
  data.index["tolerance_um"] = json.at("tolerance_um");
  const cutting::Design design = result_map(job, cases.front().verdict).design;
  Shared shared{order_along_curve(design.vertices), {}, {}};
  add_mesh(data, design, shared.order);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (!is_same_mesh(cases[i].job->design_w, job.design_w)) {
      report.warnings.push_back(fmt::format(
          "{} is in the table and not among the maps: its part has {} vertices of its own, the "
          "maps of the report share {}",
          cases[i].verdict.cut.name, cases[i].job->design_w.vertices.rows(),
          job.design_w.vertices.rows()));
      continue;
    }
    add_case(data, result_map(*cases[i].job, cases[i].verdict), json.at("cases").at(i), shared);
  }
  if (job.stretches.empty() && job.samples.states.size() > 1)
    add_machine(data, job);
  else
    report.warnings.push_back(
        fmt::format("the motion of the machine is left out of the report: the program has {} "
                    "samples and {} tools, and one tool is shown",
                    job.samples.states.size(), std::max<std::size_t>(1, job.stretches.size())));
  report.html =
      filled(viewer_page(), {{"language", asked.language},
                             {"title", in_html(comparison.scene)},
                             {"style", std::string(viewer_style())},
                             {"script", std::string(viewer_script())},
                             {"labels", in_script(labels_json(report_labels()))},
                             {"figures", figures_table(json, data)},
                             {"words", words(cases, json, report.warnings, asked)},
                             {"data", "<script type=\"application/json\" id=\"index\">" +
                                          in_script(data.index) + "</script>\n" + data.blocks}});
  return report;
}

}  // namespace abbe::sim
