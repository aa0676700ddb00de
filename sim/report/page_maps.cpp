#include "sim/report/page_maps.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "sim/report/mesh_walk.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

constexpr double coarsest_um = 2e-3, finest_um = 1e-3;  // residual
constexpr int cut_time_step_ms = 20;
constexpr double ms = 1e-3;

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
  std::map<int, int> midst;                        ///< of each line in cut_time_step; or empty
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
std::map<int, int> midst_of_lines(PageData& data, const LineStretches& stretches) {
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
  add(data, {"block_line"}, packed_numbers(column(line)));
  Packed times = packed_numbers(column(begin_ms));
  times.step = {ms};
  times.offset = {0.0};
  add(data, {"block_time"}, times);
  return midst;
}

void add_times(PageData& data, const CaseMap& map, const std::string& number, Shared& shared) {
  Column line{"line" + number, 0.0, Eigen::VectorXi(map.residual_um.size())};
  Column midst{"midst:" + line.name, cut_time_step_ms * ms, line.numbers};
  for (Eigen::Index k = 0; k < line.numbers.size(); ++k) {
    line.numbers[k] = map.cut_line[std::size_t(shared.walk.order[std::size_t(k)])];
    const auto at = shared.midst.find(line.numbers[k]);
    midst.numbers[k] = at == shared.midst.end() ? 0 : at->second;
  }
  shared.line.push_back(add_column(data, shared, line, shared.line));
  std::vector<Column> others = shared.time;
  if (!shared.midst.empty()) others.push_back(midst);
  shared.time.push_back(add_column(
      data, shared, in_steps("cut_time" + number, map.cut_time_s, midst.step, shared), others));
}

void add_layers(PageData& data, const CaseMap& map, bool has_form, Shared& shared) {
  const std::string number = std::to_string(data.index["cases"].size());
  const double step = residual_step(map.residual_um);
  shared.residual.push_back(add_column(
      data, shared, in_steps("residual" + number, map.residual_um, step, shared), shared.residual));
  if (has_form)
    shared.form.push_back(add_column(
        data, shared, in_steps("form" + number, map.form_um, step, shared), shared.form));
  add_times(data, map, number, shared);
  data.index["cases"].push_back(
      {{"name", map.name}, {"step_nm", 1e3 * step}, {"stats", map.shown}});
}

void add_mesh(PageData& data, const PartMaps& maps, const MeshWalk& walk) {
  data.index["vertices"] = maps.vertices.rows();
  data.index["triangles"] = maps.triangles.rows();
  add_block(data, "mesh", base64(walk.code));
  const Eigen::MatrixXd vertices = maps.vertices(walk.order, Eigen::all);
  add(data, {"position", true, {}},
      packed_values(vertices, step_of_16_bits(vertices), {&walk, {}}));
}

void add_regions(PageData& data, const PartMaps& maps, const MeshWalk& walk) {
  data.index["regions"] = maps.regions;
  if (maps.regions.empty()) return;
  const Eigen::Map<const Eigen::VectorXi> numbers(maps.region.data(),
                                                  Eigen::Index(maps.region.size()));
  add(data, {"region", true, {}}, packed_numbers(numbers(walk.order), {&walk, {}}));
}

bool has_mesh(const PartMaps& maps, const cutting::Design& design) {
  return maps.vertices.rows() == design.vertices.rows() &&
         maps.triangles.rows() == design.triangles.rows() && maps.triangles == design.triangles &&
         (maps.vertices - design.vertices).cwiseAbs().maxCoeff() < 1e-6;
}

bool fits(const Eigen::VectorXd& values, double step) {
  return std::ranges::all_of(values, [&](double value) {
    return std::isnan(value) || std::abs(value) <= step * largest_packed;
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

ordered_json shown_figures(const ordered_json& figures) {
  const auto of = [&](const char* map, const char* key) {
    const ordered_json all = figures.value(map, ordered_json());
    const bool is_there = all.is_object() && all.contains(key) && all.at(key).is_number();
    return is_there ? fmt::format("{:.4g}", all.at(key).get<double>()) : std::string("–");
  };
  return {{"residual", "PV " + of("residual_um", "pv") + "  RMS " + of("residual_um", "rms")},
          {"form", "PV " + of("form_um", "pv") + "  RMS " + of("form_um", "rms")},
          {"texture", "Sz " + of("texture_um", "Sz") + "  Sq " + of("texture_um", "Sq")}};
}

std::optional<std::string> too_large_to_pack(const CaseMap& one) {
  const double step = residual_step(one.residual_um);
  if (!fits(one.residual_um, step)) return "a deviation";
  if (!fits(one.form_um, step)) return "a form";
  if (!fits(one.cut_time_s, cut_time_step_ms * ms)) return "an instant of cutting";
  if (std::ranges::any_of(one.cut_line, [](int line) { return line < 0 || line > largest_packed; }))
    return "a line of the program";
  return std::nullopt;
}

void add_maps(PageData& data, const PartMaps& maps) {
  Shared shared{mesh_walk(maps.triangles, maps.vertices.rows()), {}, {}, {}, {}, {}};
  add_mesh(data, maps, shared.walk);
  add_regions(data, maps, shared.walk);
  shared.midst = midst_of_lines(data, maps.stretches);
  const bool has_form =
      std::ranges::all_of(maps.cases, [](const CaseMap& one) { return one.form_um.size() > 0; });
  for (const CaseMap& one : maps.cases) add_layers(data, one, has_form, shared);
}

}  // namespace abbe::sim
