#include "sim/study/study_checks.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "sim/scene/bad_scene.h"
#include "sim/study/histories.h"
#include "sim/study/plan.h"
#include "sim/study/study_fields.h"

namespace abbe::sim::study {
namespace {

void check_engine(const Study& study, const std::vector<Place>& places, TableReader& reader) {
  const auto needs = [&](bool asked, const char* key) {
    if (asked && study.engine == Engine::Full)
      reader.refuse("engine", fmt::format("\"influence\" or \"both\" for [{}]", key), "\"full\"");
  };
  needs(study.worst_case.has_value(), "worst_case");
  needs(study.tolerance.has_value(), "tolerance");
  needs(study.uncertainty.has_value(), "uncertainty");
  if (study.engine == Engine::Both && !study.monte_carlo)
    reader.refuse("engine", "[monte_carlo] with \"both\": the first of its cases are the proof",
                  "none");
  if (study.monte_carlo && reader.has("proofs") && study.proofs > study.monte_carlo->cases)
    reader.refuse("proofs",
                  fmt::format("at most {}, the cases of [monte_carlo]", study.monte_carlo->cases),
                  std::to_string(study.proofs));
  if (study.engine == Engine::Full) return;
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    if (reshapes(study.inputs[i]))
      reader.faults().add(
          places[i],
          "engine = \"full\" for an input that changes part, program, nominal machine or "
          "stock",
          study.inputs[i].name);
}

bool has_tolerance(const PartDescription& part) {
  return part.tolerance || std::ranges::any_of(part.regions, [](const PartRegion& region) {
           return region.tolerance.has_value();
         });
}

/// Figures that nobody would get.
void check_judged(const Study& study, const std::vector<Scene>& scenes, TableReader& reader) {
  const auto is_asked = [&](Response response) {
    const auto& all = study.responses;
    return std::find(all.begin(), all.end(), response) != all.end();
  };
  for (const auto& [response, limit] : study.limits)
    if (!is_asked(response))
      reader.refuse("limits", "limits of what `responses` asks for",
                    std::string(name_of(response)) + "_um");
  for (std::size_t a = 0; a < scenes.size(); ++a)
    if (is_asked(Response::InTolerance) && !has_tolerance(scenes[a].part))
      reader.refuse("responses", "a part with tolerance_um for in_tolerance",
                    "none of " + study.arms[a].name);
}

void check_inputs(const Study& study, TableReader& reader) {
  if (study.sobol && !study.copula.groups().empty())
    reader.refuse("sobol_indices", "independent inputs", "correlated ones");
  const bool asks = study.one_at_a_time || study.monte_carlo || study.sobol ||
                    !study.sweeps.empty() || study.worst_case || study.tolerance ||
                    study.uncertainty;
  if (study.inputs.empty() && (asks || !study.histories))
    reader.faults().add(reader.place(), "at least one [[input]] or [[inputs]]", "none");
  if (study.sobol && study.inputs.size() > 1800)
    reader.refuse("sobol_indices", "at most 1800 inputs", std::to_string(study.inputs.size()));
  if (const std::uint64_t cases = plan_of(study).cases; cases > most_cases)
    reader.faults().add(reader.place(), fmt::format("at most {} cases in all", most_cases),
                        std::to_string(cases));
}

/// Where an input sets what the scene refuses; else the fault's own place.
Place place_of(const BadInput& fault, const Study& study, const std::vector<Place>& places) {
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    for (const Setting& one : study.inputs[i].settings)
      if (fault.file.starts_with("--set " + one.path + "=")) return places[i];
  return {std::make_shared<const std::string>(fault.file), fault.line, fault.column};
}

void try_arm(const Study& study, std::size_t at, const Scene& scene,
             const std::vector<Place>& places, Faults& faults) {
  const Arm& arm = study.arms[at];
  std::set<std::string> known;
  for (const errors::Element& element : scene.geometric.elements)
    known.insert(errors::to_string(element.name));
  for (const errors::Coefficient& one : errors::coefficients(scene.geometric.elements))
    known.insert(errors::name_of(one, scene.geometric.elements));
  for (std::size_t i = 0; i < study.inputs.size(); ++i) {
    const Input& input = study.inputs[i];
    if (const std::string name = input.element + input.number; !name.empty() && !known.count(name))
      faults.add(places[i], "an element or number that the scene's errors have",
                 with_meant(name, known));
  }
  if (!faults.empty()) return;
  try {
    scene_at(study, arm, scene, centre(study));
    for (const Sweep& sweep : study.sweeps)
      for (const double value : {sweep.values.minCoeff(), sweep.values.maxCoeff()}) {
        Eigen::VectorXd x = centre(study);
        x[sweep.input] = value;
        scene_at(study, arm, scene, x);
      }
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.faults)
      faults.add(place_of(fault, study, places), fault.expected, fault.seen);
  }
}

}  // namespace

void check_together(const Study& study, const std::vector<Scene>& scenes,
                    const std::vector<Place>& places, TableReader& reader) {
  check_engine(study, places, reader);
  check_judged(study, scenes, reader);
  check_inputs(study, reader);
}

void try_paths(const Study& study, const std::vector<Scene>& scenes,
               const std::vector<Place>& places, Faults& faults) {
  for (std::size_t a = 0; a < study.arms.size(); ++a) try_arm(study, a, scenes[a], places, faults);
}

void try_days(const Study& study, TableReader& reader) {
  const Histories& histories = *study.histories;
  std::set<std::string> days(histories.train.begin(), histories.train.end());
  days.insert(histories.test.begin(), histories.test.end());
  try {
    case_of_histories(study);
    for (const std::string& day : days) scene_of(study, {day, day, "uncompensated"});
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.faults)
      reader.faults().add(reader.know("histories")->place, fault.expected, fault.seen);
  } catch (const BadInput& fault) {
    reader.refuse("histories", fault.expected, fault.seen);
  }
}

}  // namespace abbe::sim::study
