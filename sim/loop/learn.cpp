#include "sim/loop/learn.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "sim/cut/commands.h"
#include "sim/loop/correction_channels.h"
#include "sim/loop/correctors.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::Pose;
using Channel = CaseDescription::Channel;
using Kind = CaseDescription::Belief;

std::vector<AxisState> uncorrected(const ControlView& view, const Eigen::Vector3d& offset_w) {
  return commanded(view.machine.control, view.path, view.samples, view.machine.nominal, offset_w);
}

/// Input of a corrector: commands, and the poses of the tool that they should reach.
struct CorrectionTargets {
  std::vector<AxisState> commanded;
  std::vector<Pose> T_wt;
};

/// Returns the commands and targets of the program after the datum was measured while the corrector
/// acts. A perfect belief knows the absolute pose of the tool. All others know it relative to the
/// datum only, so their targets move with the measured shift.
CorrectionTargets targets_at_datum(const ControlView& view, const MachineAccess& machine_access,
                                   const Corrector& at_datum, bool knows_absolute_pose) {
  if (knows_absolute_pose)
    return {uncorrected(view, machine_access.touch_off({})), view.T_wt_nominal};
  CorrectionTargets result{uncorrected(view, Eigen::Vector3d::Zero()), view.T_wt_nominal};
  const Eigen::Vector3d offset_w = machine_access.touch_off(at_datum);
  if (offset_w.isZero(0.0)) return result;
  std::vector<AxisState> shifted = uncorrected(view, offset_w);
  const kinematics::Chain& control = view.machine.control;
  tbb::parallel_for(std::size_t(0), shifted.size(), [&](std::size_t i) {
    const Pose from = control.tool_in_workpiece(result.commanded[i].q);
    result.T_wt[i] = control.tool_in_workpiece(shifted[i].q) * from.inverse() * result.T_wt[i];
  });
  result.commanded = std::move(shifted);
  return result;
}

/// Returns true if the corrector knows the absolute pose of the tool, not only relative to the
/// datum. Tables are active while the datum is measured, for every belief.
bool knows_absolute_pose(const CaseDescription& compensator) {
  return compensator.plug_in.empty() && compensator.belief == Kind::Perfect &&
         compensator.channel != Channel::Table;
}

/// Corrects the program of a tool.
/// @param view  of the tool
CorrectedProgram correct_ranges(const RangeVisitor& visit_ranges, const ControlView& view,
                                const MachineAccess& machine_access,
                                const CaseDescription& compensator,
                                const LearnedCorrection& case_correction) {
  const Corrector& corrector = case_correction.corrector;
  const Corrector& at_datum = case_correction.at_datum ? case_correction.at_datum : corrector;
  const Eigen::Vector3d measured_w = machine_access.touch_off({});
  CorrectedProgram result = correct_program(
      visit_ranges, corrector,
      knows_absolute_pose(compensator) ? measured_w
                                       : expected_offset(view.datum, view.machine, at_datum),
      measured_w);
  result.warnings = case_correction.warnings;
  return result;
}

/// Returns the visitor of a program in one range.
RangeVisitor single_range(const ControlView& view) {
  return [&view](const auto& use) { use(view); };
}

/// Applies a correction through the channel of the case and returns the commands.
Commands deliver_correction(const ControlView& view, const MachineAccess& machine_access,
                            const CaseDescription& compensator, LearnedCorrection case_correction) {
  if (compensator.channel == Channel::Table) {
    if (!case_correction.tables)
      case_correction.tables =
          control_tables(view, case_correction.corrector, case_correction.geometric);
    case_correction.corrector = table_corrector(view, *case_correction.tables);
    case_correction.at_datum = {};  // tables are always active
    for (const std::string& omission : case_correction.tables->omissions)
      case_correction.warnings.push_back("table: " + omission);
  }
  const Corrector& corrector = case_correction.corrector;
  const Corrector& at_datum = case_correction.at_datum ? case_correction.at_datum : corrector;
  Commands result;
  if (compensator.channel == Channel::Program) {
    const CorrectedProgram corrected =
        correct_ranges(single_range(view), view, machine_access, compensator, case_correction);
    result = run_corrected_program({&view, 1}, {&corrected, 1}, view.path, view.control);
  } else {
    const CorrectionTargets targets =
        targets_at_datum(view, machine_access, at_datum, knows_absolute_pose(compensator));
    CorrectedCommands ideal = corrector(targets.commanded, targets.T_wt);
    if (compensator.channel == Channel::Ideal || compensator.channel == Channel::Table) {
      result.samples = view.samples;
      if (compensator.channel == Channel::Table)
        for (std::size_t i = 0; i < ideal.states.size(); ++i)
          result.correction.push_back(ideal.states[i].q - targets.commanded[i].q);
      result.samples.states = std::move(ideal.states);
    } else {
      result = apply_real_time_channel(view, compensator.channel, targets.commanded, ideal.states);
    }
    result.remaining_point_error = ideal.remaining_point_error;
    result.remaining_direction_error = ideal.remaining_direction_error;
    result.not_converged = ideal.not_converged;
  }
  result.warnings = std::move(case_correction.warnings);
  return result;
}

/// Returns the load of the cut, simulated on the believed machine with the present commands.
compensation::LoadSeries believed_load(const ControlView& view, const MachineAccess& machine_access,
                                       const Commands& commands,
                                       compensation::MachineBelief believed) {
  believed.force = {errors::bind(view.belief.force->compliance, view.machine.control), {}};
  return machine_access.simulate_load(commands, [&](std::size_t i, const errors::Load& load) {
    Pose tool = tool_in_workpiece(believed, commands.samples.states[i], load);
    if (const auto& piezo = commands.piezo)
      tool.translation() +=
          piezo->stroke[Eigen::Index(i)] * (tool.linear() * piezo->piezo.direction_t);
    return tool;
  });
}

/// Collector of evidence over the passes in which a compensator learns.
class CorrectionLearner {
 public:
  CorrectionLearner(const ControlView& view, const MachineAccess& machine_access,
                    const CaseDescription& compensator);

  int passes() const { return passes_; }
  const Evidence& evidence() const { return evidence_; }
  /// Runs the present commands and learns from the signals that the control reads.
  void read(const Commands& commands);
  /// Cuts with the present commands, measures the part and learns from it.
  void measure_part(const Commands& commands, int pass);
  /// Returns true if the part of a pass is measured.
  bool measures_part(int pass) const;
  /// Returns true if the case uses other beliefs than the measured part.
  bool has_other_beliefs() const;

 private:
  bool uses_belief(Kind kind) const {
    return is_belief_enabled(view_.belief, compensator_.belief, kind);
  }

  const ControlView& view_;
  const MachineAccess& machine_access_;
  const CaseDescription& compensator_;
  int passes_ = 0;
  Evidence evidence_;
  std::optional<cutting::Surface> error_free_;
  Eigen::VectorXd total_;  ///< (vertices) mm, deviation from all readings so far
};

CorrectionLearner::CorrectionLearner(const ControlView& view, const MachineAccess& machine_access,
                                     const CaseDescription& compensator)
    : view_(view), machine_access_(machine_access), compensator_(compensator) {
  if (!compensator.plug_in.empty()) {
    passes_ = 1;  // a plug-in gets the readings of the uncorrected program
    return;
  }
  const BeliefDescription& beliefs = view.belief;
  if (uses_belief(Kind::Thermal)) passes_ = 1;
  if (uses_belief(Kind::Force) && beliefs.force) passes_ = std::max(passes_, beliefs.force->passes);
  if (uses_belief(Kind::Part) && beliefs.part) passes_ = std::max(passes_, beliefs.part->passes);
}

bool CorrectionLearner::measures_part(int pass) const {
  const BeliefDescription& beliefs = view_.belief;
  return compensator_.plug_in.empty() && uses_belief(Kind::Part) && beliefs.part &&
         pass < beliefs.part->passes;
}

bool CorrectionLearner::has_other_beliefs() const {
  return uses_belief(Kind::Identified) || uses_belief(Kind::Thermal) || uses_belief(Kind::Force);
}

compensation::CurrentLaw train_law(const MachineAccess& machine_access,
                                   const BeliefDescription::Force& force) {
  const TrainingRun run = machine_access.training();
  try {
    return compensation::fit_current_law(run.log, run.training, force.smoothing_s);
  } catch (const std::invalid_argument& exception) {
    throw BadInput(force.training.string(), 0, 0,
                   "a part from which the current model can be learned", exception.what());
  }
}

void CorrectionLearner::read(const Commands& commands) {
  using From = BeliefDescription::Force::From;
  const BeliefDescription& beliefs = view_.belief;
  const bool is_plug_in = !compensator_.plug_in.empty();
  const bool uses_force = !is_plug_in && uses_belief(Kind::Force) && beliefs.force;
  // There is no force in air, so the blank is cut if the force is read.
  const bool cuts_blank =
      (uses_force && beliefs.force->from != From::Model) || (is_plug_in && view_.is_cut);
  if (cuts_blank || is_plug_in || uses_belief(Kind::Thermal))
    evidence_.log = machine_access_.run(commands, cuts_blank);
  if (!uses_force) return;
  if (beliefs.force->from == From::Current && !evidence_.law)
    evidence_.law = train_law(machine_access_, *beliefs.force);
  // The model uses the other beliefs, so it follows the log.
  if (beliefs.force->from == From::Model)
    evidence_.model_load = believed_load(view_, machine_access_, commands,
                                         machine_belief(view_, compensator_, evidence_));
}

void CorrectionLearner::measure_part(const Commands& commands, int pass) {
  if (!error_free_) error_free_ = machine_access_.error_free();
  const auto [readings, spacing] = machine_access_.measure_cut_part(commands, pass);
  // Cusps are intended, and corrections of the tool cannot remove them.
  const Eigen::VectorXd machine_deviation =
      readings.deviation - program_residuals(view_, *error_free_, readings.points_w);
  // The deviation is unknown farther than five spacings from every reading.
  const Eigen::VectorXd interpolated_deviation = compensation::interpolate_readings(
      readings.points_w, machine_deviation, view_.design_w.vertices, 5.0 * spacing);
  // The part was cut with the correction by earlier readings, so its deviation adds to theirs.
  total_ = total_.size() == 0 ? interpolated_deviation
                              : Eigen::VectorXd(total_ + interpolated_deviation);
  evidence_.part = part_series(view_, *error_free_, total_);
}

/// Returns warnings about terms of a thermal belief that are larger than heat can cause.
std::vector<std::string> size_warnings(const compensation::ThermalBelief& belief,
                                       const compensation::ThermalSeries& series) {
  constexpr double large_mm = 1.0, large_rad = 0.01;  // slopes: over 1 m or 1 rad of travel
  std::vector<std::string> warnings;
  for (std::size_t k = 0; k < series.terms.size() && series.value.rows() > 0; ++k) {
    const compensation::ThermalBelief::Term& term = belief.terms[k];
    const bool is_slide = std::string_view("XYZUVW").find(term.name.axis) != std::string_view::npos;
    const double travel = term.slope && is_slide ? 1000.0 : 1.0;
    const double size = travel * series.value.col(Eigen::Index(k)).cwiseAbs().maxCoeff();
    if (size < (term.name.is_angle() ? large_rad : large_mm)) continue;
    warnings.push_back(
        fmt::format("belief.thermal: {} {} is {:.4g} {}{}, which is implausible for thermal "
                    "deformation: check its unit and the unit of the temperatures",
                    errors::to_string(term.name), term.slope ? "slope" : "offset",
                    size * (term.name.is_angle() ? 1e3 : 1.0), term.name.is_angle() ? "mrad" : "mm",
                    term.slope ? (is_slide ? " over 1 m" : " over 1 rad") : ""));
  }
  return warnings;
}

/// Returns the correction by the evidence so far.
LearnedCorrection evidence_corrector(const ControlView& view, const MachineAccess& machine_access,
                                     const CaseDescription& compensator, const Evidence& evidence) {
  if (!compensator.plug_in.empty()) {
    if (!compensator.function) machine_access.check_trusted(compensator.plug_in);
    return {plug_in_corrector(view, compensator, evidence.log), {}, {}, {}};
  }
  if (compensator.belief == Kind::Perfect)
    return {machine_access.perfect(view, compensator), {}, {}, {}};
  compensation::MachineBelief belief = machine_belief(view, compensator, evidence);
  LearnedCorrection case_correction{{}, {}, belief.geometric, {}};
  if (belief.thermal && belief.thermal->limited_rows > 0)
    case_correction.warnings.push_back(fmt::format(
        "thermal belief: {} of {} readings were outside the training range and were limited to it",
        belief.thermal->limited_rows, belief.thermal->time_s.size()));
  if (belief.thermal && view.belief.thermal)
    std::ranges::move(size_warnings(*view.belief.thermal, *belief.thermal),
                      std::back_inserter(case_correction.warnings));
  const auto corrector = [&](compensation::MachineBelief believed) {
    return belief_corrector(view, compensator, [believed = std::move(believed)](const auto& state) {
      return tool_in_workpiece(believed, state);
    });
  };
  // The deviations of the part are relative to the datum, so their correction must not shift the
  // datum.
  if (belief.part) {
    compensation::MachineBelief without_part = belief;
    without_part.part.reset();
    case_correction.at_datum = corrector(std::move(without_part));
  }
  case_correction.corrector = corrector(std::move(belief));
  return case_correction;
}

/// Returns the case; that of a plug-in gets the strategy and the channel of the scene.
CaseDescription with_plug_in_settings(const ControlView& view, CaseDescription compensator) {
  if (compensator.plug_in.empty()) return compensator;
  compensator.strategy = view.compensation.plug_in.strategy;
  compensator.channel = view.compensation.plug_in.channel;
  return compensator;
}

/// Calls `compute` and converts its exceptions into input errors that name the compensator.
template <class Computation>
auto with_input_errors(const ControlView& view, const CaseDescription& description,
                       const Computation& compute) {
  const auto input_error = [&](const std::string& actual) {
    return BadInput(view.file.string(), 0, 0,
                    "a compensator that works with this program: " + description.name, actual);
  };
  try {
    return compute();
  } catch (const std::out_of_range& exception) {  // outside a table of the belief
    throw input_error(exception.what());
  } catch (const std::invalid_argument& exception) {
    throw input_error(exception.what());
  }
}

/// Learns in passes, as `learn_correction`, whose exceptions may be others than BadInput.
LearnedCorrection learn_in_passes(const ControlView& view, const MachineAccess& machine_access,
                                  const CaseDescription& description, const Progress& progress) {
  const CaseDescription compensator = with_plug_in_settings(view, description);
  CorrectionLearner learner(view, machine_access, compensator);
  const auto current_corrector = [&] {
    return evidence_corrector(view, machine_access, compensator, learner.evidence());
  };
  if (learner.passes() == 0) return current_corrector();
  Commands commands =
      uncompensated_commands(view.machine, view.path, view.samples, machine_access.touch_off({}));
  // The program runs uncorrected in the first pass, and with the present correction in later
  // passes.
  for (int pass = 0; pass < learner.passes(); ++pass) {
    if (progress) progress("learn", double(pass) / learner.passes());
    if (pass > 0)
      commands = deliver_correction(view, machine_access, compensator, current_corrector());
    learner.read(commands);
    if (!learner.measures_part(pass)) continue;
    // A part shows the remaining error, so the other beliefs are applied before it is cut;
    // otherwise the same errors would be corrected twice.
    if (pass == 0 && learner.has_other_beliefs())
      commands = deliver_correction(view, machine_access, compensator, current_corrector());
    learner.measure_part(commands, pass);
  }
  return current_corrector();
}

}  // namespace

LearnedCorrection learn_correction(const ControlView& view, const MachineAccess& machine_access,
                                   const CaseDescription& description, const Progress& progress) {
  return with_input_errors(view, description, [&] {
    return learn_in_passes(view, machine_access, description, progress);
  });
}

Commands compensated_commands(const ControlView& view, const MachineAccess& machine_access,
                              const CaseDescription& description, const Progress& progress) {
  const LearnedCorrection correction =
      learn_correction(view, machine_access, description, progress);
  if (progress) progress("correct", 0.0);
  return compensated_commands(view, machine_access, description, correction);
}

CorrectedProgram corrected_program(const ControlView& view, const MachineAccess& machine_access,
                                   const CaseDescription& description, const Progress& progress) {
  const LearnedCorrection correction =
      learn_correction(view, machine_access, description, progress);
  if (progress) progress("correct", 0.0);
  return corrected_program(single_range(view), view, machine_access, description, correction);
}

CorrectedProgram corrected_program(const RangeVisitor& visit_ranges, const ControlView& view,
                                   const MachineAccess& machine_access,
                                   const CaseDescription& description,
                                   const LearnedCorrection& case_correction) {
  return with_input_errors(view, description, [&] {
    return correct_ranges(visit_ranges, view, machine_access,
                          with_plug_in_settings(view, description), case_correction);
  });
}

Commands compensated_commands(const ControlView& view, const MachineAccess& machine_access,
                              const CaseDescription& description,
                              const LearnedCorrection& case_correction) {
  return with_input_errors(view, description, [&] {
    return deliver_correction(view, machine_access, with_plug_in_settings(view, description),
                              case_correction);
  });
}

}  // namespace abbe::sim
