#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/study/budget.h"
#include "sim/study/csv_field.h"
#include "sim/study/ranking.h"
#include "sim/study/words.h"

namespace abbe::sim::study {
namespace {

using Cells = std::vector<std::string>;

/// A value of a response goes into the column of micrometres or into that of percents.
Cells fields(Response response, const std::optional<double>& value) {
  const std::string text = value ? csv_field(in_unit(response, *value)) : "";
  return response == Response::InTolerance ? Cells{"", text} : Cells{text, ""};
}

Cells fields(const Banded& b) { return {csv_field(b.value), csv_field(b.low), csv_field(b.high)}; }

Cells fields(const std::optional<SobolIndex>& index) {
  Cells all = index ? fields(index->first) : Cells(3);
  const Cells total = index ? fields(index->total) : Cells(3);
  all.insert(all.end(), total.begin(), total.end());
  return all;
}

constexpr const char* csv_head =
    "arm,response,input,input_unit,centre,standard_deviation,cost,"
    "low_um,low_percent,high_um,high_percent,share_of_squares_percent,"
    "sobol_first,sobol_first_low,sobol_first_high,sobol_total,sobol_total_low,sobol_total_high,"
    "correlation,rank_correlation,main_effect_percent,map_rms_um,map_pv_um,map_share_percent,"
    "equal_factor,cheapest_factor\n";

/// Of an input, if all have one.
std::string field_of(const Eigen::VectorXd& values, Eigen::Index i) {
  return i < values.size() ? csv_field(values[i]) : "";
}

}  // namespace

std::string to_csv(const Budget& budget) {
  const Study& study = budget.study;
  const Eigen::VectorXd centres = centre(study), deviations = spreads(study);
  std::string text = csv_head;
  for (const ArmBudget& arm : budget.arms) {
    const Eigen::VectorXd none;
    const Eigen::VectorXd& equal = arm.allocation ? arm.allocation->equal : none;
    const Eigen::VectorXd& cheapest = arm.allocation ? arm.allocation->cheapest : none;
    for (const ResponseBudget& r : arm.responses) {
      const Ranking squares = change_ranking(r, study.inputs.size());
      for (const Contribution& c : r.contributions) {
        const auto i = std::size_t(c.input);
        const Input& input = study.inputs[i];
        const std::optional<MapContribution> map =
            i < arm.maps.size() ? std::optional(arm.maps[i]) : std::nullopt;
        Cells row{csv_field(arm.arm.name),     name_of(r.response),
                  csv_field(input.name),       csv_field(unit_of(input)),
                  csv_field(centres[c.input]), csv_field(deviations[c.input]),
                  csv_field(input.cost)};
        const auto add = [&](const Cells& more) {
          row.insert(row.end(), more.begin(), more.end());
        };
        add(fields(r.response, c.low));
        add(fields(r.response, c.high));
        add({larger_change(c) ? csv_field(100.0 * squares.shares[c.input]) : ""});
        add(fields(c.sobol));
        add({csv_field(c.correlation), csv_field(c.rank_correlation),
             c.main_effect ? csv_field(100.0 * *c.main_effect) : ""});
        add(map ? Cells{csv_field(map->rms / units::um), csv_field(map->pv / units::um),
                        csv_field(100.0 * map->share)}
                : Cells(3));
        add({field_of(equal, c.input), field_of(cheapest, c.input)});
        text += fmt::format("{}\n", fmt::join(row, ","));
      }
    }
  }
  return text;
}

}  // namespace abbe::sim::study
