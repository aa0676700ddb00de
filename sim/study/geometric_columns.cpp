#include <algorithm>
#include <set>

#include <tbb/parallel_for.h>

#include "errors/coefficients.h"
#include "kinematics/jacobian.h"
#include "sim/study/contact_motion.h"
#include "sim/study/influence_columns.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;

/// The elements through which an input acts if it acts through elements only; else none.
std::set<std::string> elements_of(const Input& input) {
  std::set<std::string> names;
  if (!input.element.empty()) names.insert(input.element);
  if (!input.number.empty()) names.insert(input.number.substr(0, input.number.find_first_of(" [")));
  for (const Setting& one : input.settings) {
    const std::string errors = "errors.";
    if (!one.path.starts_with(errors)) return {};
    const std::size_t end = one.path.find('.', errors.size());
    names.insert(one.path.substr(errors.size(), end - errors.size()));
  }
  return names;
}

errors::GeometricErrors only(const errors::GeometricErrors& all,
                             const std::set<std::string>& names) {
  errors::GeometricErrors some;
  some.measuring_lines = all.measuring_lines;
  for (const errors::Element& element : all.elements)
    if (names.count(errors::to_string(element.name))) some.elements.push_back(element);
  return some;
}

/// Whether nothing but elements can distinguish two scenes of the same input: their run-out
/// is in the tools.
bool same_tools(const ToolDescription& a, const ToolDescription& b) {
  if (a.actual_length != b.actual_length) return false;
  const auto* x = std::get_if<cutting::Cutter>(&a.actual);
  const auto* y = std::get_if<cutting::Cutter>(&b.actual);
  return !x || !y || same_shape(*x, *y);
}

Twist twist_of(const GeometricInput& input, const kinematics::AxisState& state,
               const Eigen::MatrixXd& J_motion, const Eigen::MatrixXd& J_location) {
  Twist twist = Twist::Zero();
  const auto add = [&](const errors::GeometricModel& model, double factor) {
    const auto joints = errors::deviations(model, state);
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const Index at = 6 * Index(i);
      if (!joints[i].motion.isZero(0.0))
        twist += factor * (J_motion.middleCols<6>(at) * joints[i].motion);
      if (!joints[i].location.isZero(0.0))
        twist += factor * (J_location.middleCols<6>(at) * joints[i].location);
    }
  };
  add(input.with, input.per_unit);
  add(input.without, -input.per_unit);
  return twist;
}

}  // namespace

std::optional<GeometricInput> geometric_input(const BaseRun& run, Index input,
                                              const std::array<Scene, 2>& scenes) {
  if (run.ready.commanded_for_each) return std::nullopt;
  const std::set<std::string> names = elements_of(run.study.inputs[std::size_t(input)]);
  const std::array parts{only(scenes[0].geometric, names), only(scenes[1].geometric, names)};
  for (const errors::GeometricErrors& part : parts)
    if (names.empty() || part.elements.size() != names.size()) return std::nullopt;
  if (!same_tools(scenes[0].tool, scenes[1].tool)) return std::nullopt;
  const kinematics::Chain& chain = run.ready.job.truth.actual;
  const double scale = scenes[0].error_scale;
  const std::array<double, 2> at = around(run.study, input);
  return GeometricInput{input, errors::scaled(errors::bind(parts[1], chain), scale),
                        errors::scaled(errors::bind(parts[0], chain), scale),
                        1.0 / (at[1] - at[0])};
}

Columns geometric_columns(const BaseRun& run, const std::vector<GeometricInput>& inputs) {
  const Index count = Index(inputs.size()), rivals = Index(run.rivals.size());
  Columns columns{Eigen::MatrixXd(count, rivals), Eigen::MatrixXd(count, rivals)};
  if (inputs.empty()) return columns;
  const kinematics::Chain& chain = run.ready.job.truth.actual;
  tbb::parallel_for(std::size_t(0), run.rivals.size(), [&](std::size_t r) {
    const cutting::Rival& rival = run.rivals[r];
    const std::array<End, 2> ends = ends_of(run, rival);
    std::vector<std::array<Twist, 2>> twists(inputs.size());
    for (std::size_t e = 0; e < 2; ++e) {
      const kinematics::AxisState& state = run.ready.commanded.samples.states[ends[e].sample];
      const Eigen::MatrixXd J_motion = kinematics::motion_jacobian(chain, state.q);
      const Eigen::MatrixXd J_location = kinematics::location_jacobian(chain, state.q);
      for (std::size_t i = 0; i < inputs.size(); ++i)
        twists[i][e] = twist_of(inputs[i], state, J_motion, J_location);
    }
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const Eigen::Vector3d d = displacement(run, rival, twists[i]);
      columns.slope(Index(i), Index(r)) = rival.gradient.dot(d);
      columns.shift(Index(i), Index(r)) = rival.across.dot(d);
    }
  });
  return columns;
}

}  // namespace abbe::sim::study
