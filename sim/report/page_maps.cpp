#include "sim/report/page_maps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/regions.h"
#include "sim/report/mesh_walk.h"
#include "sim/report/page_machine.h"
#include "sim/report/result_map.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

constexpr double coarsest_um = 2e-3, finest_um = 1e-3;  // residual
constexpr int cut_time_step_ms = 20;
constexpr double ms = 1e-3;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// 1 nm, or a two-thousandth of a map that spans less than 2 um; 2 nm where that saves 16 bits.
double residual_step(const Eigen::VectorXd& residual_um) {
  const double step = step_of_16_bits(residual_um);  // a 65534th of what it spans
  if (step > coarsest_um) return finest_um;
  return std::max(step, std::min(finest_um, 32.0 * step));
}

/// A column from which others may be predicted.
struct Column {
  std::string name;
  double step = 0.0;  ///< 0: its numbers are the values
  Eigen::VectorXi numbers;
};

/// What the maps of a page share.
struct Shared {
  MeshWalk walk;
  std::map<int, int> midst;                        ///< of each line of the program, cut_time_step
  std::vector<Column> residual, form, line, time;  ///< of the maps so far
};

/// Packs the numbers of all vertices, predicted from one of `others` where that helps.
Column add_column(PageData& data, const Shared& shared, const Column& column,
                  const std::vector<Column>& others) {
  PageArray array{column.name, true, {}};
  PackOptions options{&shared.walk, {}};
  for (const Column& one : others) {
    if (one.step != column.step) continue;
    options.references.push_back(&one.numbers);
    array.references.push_back(one.name);
  }
  Packed packed = packed_numbers(column.numbers, options);
  if (column.step > 0.0) {
    packed.step = {column.step};
    packed.offset = {0.0};
  }
  add(data, array, packed);
  return {column.name, column.step, packed.numbers.col(0)};
}

Column in_steps(const std::string& name, const Eigen::VectorXd& values, double step,
                const Shared& shared) {
  return {name, step, numbers_of(values(shared.walk.order), step, {0.0})};
}

/// The instants at which the lines of the program are half done, where a line runs once the first
/// time; the page makes the same table of the same numbers.
std::map<int, int> midst_of_lines(PageData& data, const Job& job) {
  std::vector<int> line, begin_ms;
  for (const Job& part : parts_of(job)) {
    const program::Samples& samples = part.samples;
    for (std::size_t k = 0; k < samples.line.size(); ++k) {
      if (k > 0 && samples.line[k] == samples.line[k - 1]) continue;
      line.push_back(samples.line[k]);
      // a sample belongs to what ends there
      begin_ms.push_back(int(std::lround(samples.states[k > 0 ? k - 1 : 0].time_s / ms)));
    }
  }
  std::map<int, int> midst;
  for (std::size_t k = 0; k < line.size(); ++k) {
    const int end_ms = begin_ms[std::min(k + 1, line.size() - 1)];
    midst.emplace(line[k], (begin_ms[k] + end_ms + cut_time_step_ms) / (2 * cut_time_step_ms));
  }
  const auto count = Eigen::Index(line.size());
  const auto column = [&](const std::vector<int>& numbers) {
    return Eigen::Map<const Eigen::VectorXi>(numbers.data(), count);
  };
  add(data, {"block_line"}, packed_numbers(column(line)));
  Packed times = packed_numbers(column(begin_ms));
  times.step = {ms};
  times.offset = {0.0};
  add(data, {"block_time"}, times);
  return midst;
}

void add_times(PageData& data, const ResultMap& map, const std::string& number, Shared& shared) {
  Column line{"line" + number, 0.0, Eigen::VectorXi(map.residual_um.size())};
  Column midst{"midst:" + line.name, cut_time_step_ms * ms, line.numbers};
  for (Eigen::Index k = 0; k < line.numbers.size(); ++k) {
    line.numbers[k] = map.cut_line[std::size_t(shared.walk.order[std::size_t(k)])];
    const auto at = shared.midst.find(line.numbers[k]);
    midst.numbers[k] = at == shared.midst.end() ? 0 : at->second;
  }
  shared.line.push_back(add_column(data, shared, line, shared.line));
  std::vector<Column> others = shared.time;
  others.push_back(midst);
  shared.time.push_back(add_column(
      data, shared, in_steps("cut_time" + number, map.cut_time_s, midst.step, shared), others));
}

/// What stands beside a map of the residual, of its form and of its texture.
ordered_json shown_figures(const ordered_json& figures) {
  const auto of = [&](const char* map, const char* key) {
    const ordered_json& all = figures.at(map);
    const bool is_there = all.is_object() && all.contains(key) && all.at(key).is_number();
    return is_there ? fmt::format("{:.4g}", all.at(key).get<double>()) : std::string("–");
  };
  return {{"residual", "PV " + of("residual_um", "pv") + "  RMS " + of("residual_um", "rms")},
          {"form", "PV " + of("form_um", "pv") + "  RMS " + of("form_um", "rms")},
          {"texture", "Sz " + of("texture_um", "Sz") + "  Sq " + of("texture_um", "Sq")}};
}

void add_case(PageData& data, const ResultMap& map, const ordered_json& figures, Shared& shared) {
  const std::string number = std::to_string(data.index["cases"].size());
  const double step = residual_step(map.residual_um);
  shared.residual.push_back(add_column(
      data, shared, in_steps("residual" + number, map.residual_um, step, shared), shared.residual));
  shared.form.push_back(
      add_column(data, shared, in_steps("form" + number, map.form_um, step, shared), shared.form));
  add_times(data, map, number, shared);
  data.index["cases"].push_back(
      {{"name", map.facts.case_name}, {"step_nm", 1e3 * step}, {"stats", shown_figures(figures)}});
}

void add_mesh(PageData& data, const cutting::Design& design, const MeshWalk& walk) {
  data.index["vertices"] = design.vertices.rows();
  data.index["triangles"] = design.triangles.rows();
  add_block(data, "mesh", base64(walk.code));
  const Eigen::MatrixXd vertices = design.vertices(walk.order, Eigen::all);
  add(data, {"position", true, {}},
      packed_values(vertices, step_of_16_bits(vertices), {&walk, {}}));
}

bool is_same_mesh(const cutting::Design& a, const cutting::Design& b) {
  return a.vertices.rows() == b.vertices.rows() && a.triangles.rows() == b.triangles.rows() &&
         a.triangles == b.triangles && (a.vertices - b.vertices).cwiseAbs().maxCoeff() < 1e-6;
}

/// The map of what a region of the part holds, the rest not judged.
cutting::Surface within_region(const cutting::Surface& surface, const cutting::Triangles& triangles,
                               const std::vector<int>& region, int number) {
  cutting::Surface inside = surface;
  std::vector<bool> is_out(region.size());
  for (std::size_t k = 0; k < region.size(); ++k) {
    is_out[k] = region[k] != number;
    if (!is_out[k]) continue;
    inside.status[k] = cutting::VertexStatus::Outside;
    inside.residual[Eigen::Index(k)] = nan;
  }
  for (Eigen::Index t = 0; t < inside.within.size(); ++t)
    for (const int corner : triangles.row(t))
      if (is_out[std::size_t(corner)]) inside.within[t] = nan;
  std::erase_if(inside.gouges,
                [&](const cutting::Gouge& one) { return is_out[std::size_t(one.vertex)]; });
  return inside;
}

ordered_json figures_of_region(const cutting::Statistics& s) {
  const auto um = [](const std::optional<double>& mm) {
    return mm ? ordered_json(*mm / units::um) : ordered_json();
  };
  return {{"pv", um(s.pv)},
          {"rms", um(s.rms)},
          {"mean", um(s.mean)},
          {"std", um(s.std_dev)},
          {"min", um(s.min)},
          {"max", um(s.max)},
          {"p95_abs", um(s.p95_abs)},
          {"cut", s.cut_vertices},
          {"in", s.conformance ? ordered_json(s.conformance->in) : ordered_json()}};
}

/// The region of every vertex, counted from 1, 0 where none holds it, and their figures by case.
void add_regions(PageData& data, const std::vector<Compared>& cases, const cutting::Design& design,
                 const MeshWalk& walk) {
  const Job& job = *cases.front().job;
  const auto& regions = job.scene.part.regions;
  data.index["regions"] = ordered_json::array();
  if (regions.empty()) return;
  std::vector<int> region;
  for (Eigen::Index k = 0; k < design.vertices.rows(); ++k) {
    const PartRegion* one = region_at(job.scene.part, job.face_groups, region_place(design, k));
    region.push_back(one ? int(one - regions.data()) + 1 : 0);
  }
  const Eigen::Map<const Eigen::VectorXi> numbers(region.data(), Eigen::Index(region.size()));
  add(data, {"region", true, {}}, packed_numbers(numbers(walk.order), {&walk, {}}));
  for (std::size_t r = 0; r < regions.size(); ++r) {
    ordered_json figures = ordered_json::object();
    for (const Compared& one : cases) {
      if (!is_same_mesh(one.job->design_w, job.design_w)) continue;
      figures[one.verdict.cut.name] = figures_of_region(cutting::statistics(
          within_region(one.verdict.aligned.surface, design.triangles, region, int(r) + 1),
          one.job->design_w, one.verdict.tolerance));
    }
    const std::optional<Tolerance>& tolerance =
        regions[r].tolerance ? regions[r].tolerance : job.scene.part.tolerance;
    data.index["regions"].push_back(
        {{"name", regions[r].name},
         {"judged", regions[r].judged},
         {"tolerance_um",
          tolerance ? ordered_json{tolerance->lower / units::um, tolerance->upper / units::um}
                    : ordered_json()},
         {"figures", figures}});
  }
}

}  // namespace

std::vector<std::string> add_maps(PageData& data, const std::vector<Compared>& cases,
                                  const ordered_json& figures) {
  const Job& job = *cases.front().job;
  const cutting::Design design = cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
  Shared shared{mesh_walk(design.triangles, design.vertices.rows()), {}, {}, {}, {}, {}};
  add_mesh(data, design, shared.walk);
  add_regions(data, cases, design, shared.walk);
  shared.midst = midst_of_lines(data, job);
  std::vector<std::string> left_out;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (is_same_mesh(cases[i].job->design_w, job.design_w)) {
      add_case(data, result_map(*cases[i].job, cases[i].verdict), figures.at(i), shared);
      add_course(data, cases[i], data.index["cases"].size() - 1);
      continue;
    }
    left_out.push_back(fmt::format(
        "{} is in the table and not among the maps: its part has {} vertices of its own, the "
        "maps of the report share {}",
        cases[i].verdict.cut.name, cases[i].job->design_w.vertices.rows(),
        job.design_w.vertices.rows()));
  }
  return left_out;
}

}  // namespace abbe::sim
