#include "sim/study/unidentified_effects.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/alignment.h"
#include "cutting/residual.h"
#include "kinematics/units.h"
#include "sim/study/influence.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;

/// A study of the same arms whose inputs are the unidentified numbers and what hides them.
Study probe_of(Study study) {
  std::vector<Input> inputs;
  const auto add = [&](const std::string& number, double spread) {
    if (std::ranges::find(inputs, number, &Input::number) != inputs.end()) return;
    Input input;
    input.name = input.number = number;
    const auto own = std::ranges::find(study.inputs, number, &Input::number);
    if (own != study.inputs.end()) input.distribution.centre = own->distribution.centre;
    input.distribution.spread = spread;
    inputs.push_back(std::move(input));
  };
  for (const Unidentified& one : study.unidentified) {
    add(one.number, one.spread > 0.0 ? one.spread : 1.0);
    for (const auto& [number, amount] : one.hidden_by)
      if (std::ranges::find(study.inputs, number, &Input::number) != study.inputs.end())
        add(number, one.spread > 0.0 ? one.spread : 1.0);
  }
  study.inputs = std::move(inputs);
  study.copula = Copula(int(study.inputs.size()));
  study.influence.checks = 0;
  return study;
}

/// Change of the map by a standard deviation of a number, mm.
Eigen::VectorXd change_by(const Unidentified& number, const Study& probe,
                          const Eigen::MatrixXd& effects) {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(effects.cols());
  const auto add = [&](const std::string& name, double amount) {
    const auto at = std::ranges::find(probe.inputs, name, &Input::number) - probe.inputs.begin();
    if (at < std::ssize(probe.inputs))
      change += amount * number.spread * effects.row(at).transpose();
  };
  add(number.number, 1.0);
  for (const auto& [name, amount] : number.hidden_by) add(name, -amount);
  return change;
}

cutting::Surface surface_with(const InfluenceMap& influence, const Eigen::VectorXd& change) {
  cutting::Surface surface;
  surface.residual = change;
  surface.status = influence.status;
  surface.cut_time_s = Eigen::VectorXd::Zero(change.size());
  surface.cut_line.assign(std::size_t(change.size()), 0);
  return surface;
}

}  // namespace

std::vector<UnidentifiedEffect> unidentified_effects(const Study& study, const ReadyArm& ready,
                                                     const Progress& progress) {
  if (study.unidentified.empty() || ready.commanded_for_each) return {};
  const Study probe = probe_of(study);
  std::vector<UnidentifiedEffect> result;
  try {
    const InfluenceMap influence = influence_map(probe, ready, progress);
    const Eigen::MatrixXd all = effects(influence);
    for (const Unidentified& number : study.unidentified) {
      const cutting::Surface changed = surface_with(influence, change_by(number, probe, all));
      const cutting::Surface judged =
          cutting::aligned(changed, influence.design, {ready.job.scene.alignment}).surface;
      const cutting::Statistics figures = cutting::statistics(judged, influence.design, {});
      result.push_back({number, figures.rms.value_or(0.0), figures.pv.value_or(0.0)});
    }
  } catch (const BadInput&) {
    return {};  // the maps cannot follow this arm, or its part is gouged: the study itself says so
  } catch (const std::invalid_argument&) {
    return {};
  }
  return result;
}

std::string unidentified_warning(const Study& study, const ArmBudget& arm) {
  constexpr double heard = 1e-6;  // mm, of all together
  constexpr std::size_t max_named = 6;
  std::vector<const UnidentifiedEffect*> left_out;
  double together = 0.0;
  for (const UnidentifiedEffect& one : arm.unidentified)
    if (!one.number.is_drawn) {
      left_out.push_back(&one);
      together += one.rms * one.rms;
    }
  const std::string cure =
      "(unidentified = { EY0A_um = 20 } or \"typical\" in [[inputs]] draws it)";
  if (left_out.empty() && arm.unidentified.empty() &&
      std::ranges::any_of(study.unidentified, [](const auto& one) { return !one.is_drawn; }))
    return fmt::format(
        "every figure of {} leaves out {} numbers that were not identified and have no prior {}",
        arm.arm.name,
        std::ranges::count_if(study.unidentified, [](const auto& one) { return !one.is_drawn; }),
        cure);
  if (std::sqrt(together) < heard) return "";
  std::ranges::stable_sort(left_out, std::greater<>(), &UnidentifiedEffect::rms);
  std::string text = fmt::format(
      "every figure of {} leaves out what was not identified and has no prior {}: the map feels ",
      arm.arm.name, cure);
  double rest = 0.0;
  std::size_t named = 0;
  for (const UnidentifiedEffect* one : left_out) {
    if (named < max_named && one->rms >= std::max(heard, 0.05 * left_out.front()->rms)) {
      text += fmt::format("{}{} by {:.3g} um RMS per {:.3g} {}", named > 0 ? ", " : "",
                          one->number.number, one->rms / units::um, one->number.spread,
                          one->number.unit);
      ++named;
    } else {
      rest += one->rms * one->rms;
    }
  }
  if (rest > heard * heard)
    text += fmt::format(", and {} more by {:.3g} um together", left_out.size() - named,
                        std::sqrt(rest) / units::um);
  return text;
}

}  // namespace abbe::sim::study
