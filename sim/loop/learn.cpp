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

/// Input of a corrector: commands, and the pose to which each should bring the tool.
struct Aim {
  std::vector<AxisState> commanded;
  std::vector<Pose> T_wt;
};

/// Returns the program with the datum measured while the corrector acts. A perfect belief knows the
/// absolute pose of the tool; any other knows it only relative to the datum, so its targets move
/// with the measured shift.
Aim aim(const ControlView& view, const MachineAccess& machine_access, const Corrector& at_datum,
        bool absolute) {
  if (absolute) return {uncorrected(view, machine_access.touch_off({})), view.T_wt_nominal};
  Aim result{uncorrected(view, Eigen::Vector3d::Zero()), view.T_wt_nominal};
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

/// Applies a correction through the channel of the case and returns the commands.
Commands deliver_correction(const ControlView& view, const MachineAccess& machine_access,
                            const CaseDescription& compensator,
                            LearnedCorrection learned_correction) {
  if (compensator.channel == Channel::Table) {
    TableCorrector tables =
        table_corrector(view, learned_correction.corrector, learned_correction.geometric);
    learned_correction.corrector = std::move(tables.corrector);
    learned_correction.at_datum = {};  // tables always act
    for (const std::string& one : tables.left_out)
      learned_correction.warnings.push_back("table: " + one);
  }
  const Corrector& corrector = learned_correction.corrector;
  const Corrector& at_datum = learned_correction.at_datum ? learned_correction.at_datum : corrector;
  // tables act while the datum is measured, whatever belief they were made from
  const bool absolute = compensator.plug_in.empty() && compensator.belief == Kind::Perfect &&
                        compensator.channel != Channel::Table;
  Commands result;
  if (compensator.channel == Channel::Program) {
    const Eigen::Vector3d found_w = machine_access.touch_off({});
    result = apply_program_channel(
        view, corrector, absolute ? found_w : expected_offset(view.datum, view.machine, at_datum),
        found_w);
  } else {
    const Aim asked = aim(view, machine_access, at_datum, absolute);
    CorrectedCommands ideal = corrector(asked.commanded, asked.T_wt);
    if (compensator.channel == Channel::Ideal || compensator.channel == Channel::Table) {
      result.samples = view.samples;
      if (compensator.channel == Channel::Table)
        for (std::size_t i = 0; i < ideal.states.size(); ++i)
          result.correction.push_back(ideal.states[i].q - asked.commanded[i].q);
      result.samples.states = std::move(ideal.states);
    } else {
      result = apply_real_time_channel(view, compensator.channel, asked.commanded, ideal.states);
    }
    result.point_left = ideal.point_left;
    result.direction_left = ideal.direction_left;
    result.not_converged = ideal.not_converged;
  }
  result.warnings = std::move(learned_correction.warnings);
  return result;
}

/// Returns the load of the cut as the compensator computes it: on its believed machine, with the
/// commands as corrected so far.
compensation::LoadSeries computed_load(const ControlView& view, const MachineAccess& machine_access,
                                       const Commands& commands,
                                       compensation::MachineBelief believed) {
  believed.force = {errors::bind(view.belief.force->compliance, view.machine.control), {}};
  return machine_access.computed_load(commands, [&](std::size_t i, const errors::Load& load) {
    Pose tool = tool_in_workpiece(believed, commands.samples.states[i], load);
    if (const auto& piezo = commands.piezo)
      tool.translation() +=
          piezo->stroke[Eigen::Index(i)] * (tool.linear() * piezo->piezo.direction_t);
    return tool;
  });
}

/// Collects the evidence of the passes in which a compensator learns.
class CorrectionLearner {
 public:
  CorrectionLearner(const ControlView& view, const MachineAccess& machine_access,
                    const CaseDescription& compensator);

  int passes() const { return passes_; }
  const Evidence& evidence() const { return evidence_; }
  /// Runs the present commands and learns from what the control reads.
  void read(const Commands& commands);
  /// Cuts with the present commands, measures the part and learns from it.
  void measure_part(const Commands& commands, int pass);
  bool measures(int pass) const;
  /// Returns true if the belief includes more than the measured part.
  bool has_more_evidence() const;

 private:
  bool wants(Kind kind) const { return is_belief_enabled(view_.belief, compensator_.belief, kind); }

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
    passes_ = 1;  // it gets the readings of the uncorrected program
    return;
  }
  const BeliefDescription& given = view.belief;
  if (wants(Kind::Thermal)) passes_ = 1;
  if (wants(Kind::Force) && given.force) passes_ = std::max(passes_, given.force->passes);
  if (wants(Kind::Part) && given.part) passes_ = std::max(passes_, given.part->passes);
}

bool CorrectionLearner::measures(int pass) const {
  const BeliefDescription& given = view_.belief;
  return compensator_.plug_in.empty() && wants(Kind::Part) && given.part &&
         pass < given.part->passes;
}

bool CorrectionLearner::has_more_evidence() const {
  return wants(Kind::Identified) || wants(Kind::Thermal) || wants(Kind::Force);
}

compensation::CurrentLaw trained_law(const MachineAccess& machine_access,
                                     const BeliefDescription::Force& force) {
  const TrainingRun run = machine_access.training();
  try {
    return compensation::fit_current_law(run.log, run.training, force.smoothing_s);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(force.training.string(), 0, 0, "a part from which the current can be learnt",
                   fault.what());
  }
}

void CorrectionLearner::read(const Commands& commands) {
  using From = BeliefDescription::Force::From;
  const BeliefDescription& given = view_.belief;
  const bool plugged = !compensator_.plug_in.empty();
  const bool force = !plugged && wants(Kind::Force) && given.force;
  // in air there is no force, so the blank is used only if the force is read
  const bool reads_force = (force && given.force->from != From::Model) || (plugged && view_.is_cut);
  if (reads_force || plugged || wants(Kind::Thermal))
    evidence_.log = machine_access_.run(commands, reads_force);
  if (!force) return;
  if (given.force->from == From::Current && !evidence_.law)
    evidence_.law = trained_law(machine_access_, *given.force);
  // the model uses the other beliefs, so it comes after the log
  if (given.force->from == From::Model)
    evidence_.model_load = computed_load(view_, machine_access_, commands,
                                         machine_belief(view_, compensator_, evidence_));
}

void CorrectionLearner::measure_part(const Commands& commands, int pass) {
  if (!error_free_) error_free_ = machine_access_.error_free();
  const auto [readings, spacing] = machine_access_.measured_part(commands, pass);
  // Cusps are intended, and no correction of the tool removes them.
  const Eigen::VectorXd machine_deviation =
      readings.deviation - program_residuals(view_, *error_free_, readings.points_w);
  const Eigen::VectorXd here = compensation::interpolate_readings(
      // beyond five spacings from any reading nothing was measured
      readings.points_w, machine_deviation, view_.design_w.vertices, 5.0 * spacing);
  // a measured part was corrected by the earlier readings, so its deviation adds to them
  total_ = total_.size() == 0 ? here : Eigen::VectorXd(total_ + here);
  evidence_.part = part_series(view_, *error_free_, total_);
}

/// Returns warnings about terms of a thermal belief that are larger than heat can be.
std::vector<std::string> size_warnings(const compensation::ThermalBelief& belief,
                                       const compensation::ThermalSeries& course) {
  constexpr double large_mm = 1.0, large_rad = 0.01;  // of a slope: over 1 m or 1 rad of travel
  std::vector<std::string> warnings;
  for (std::size_t k = 0; k < course.terms.size() && course.value.rows() > 0; ++k) {
    const compensation::ThermalBelief::Term& term = belief.terms[k];
    const bool is_slide = std::string_view("XYZUVW").find(term.name.axis) != std::string_view::npos;
    const double travel = term.slope && is_slide ? 1000.0 : 1.0;
    const double size = travel * course.value.col(Eigen::Index(k)).cwiseAbs().maxCoeff();
    if (size < (term.name.is_angle() ? large_rad : large_mm)) continue;
    warnings.push_back(fmt::format(
        "belief.thermal: {} {} comes to {:.4g} {}{}, and heat moves no machine that far: another "
        "unit, or temperatures of another unit",
        errors::to_string(term.name), term.slope ? "slope" : "offset",
        size * (term.name.is_angle() ? 1e3 : 1.0), term.name.is_angle() ? "mrad" : "mm",
        term.slope ? (is_slide ? " over 1 m" : " over 1 rad") : ""));
  }
  return warnings;
}

/// Returns the corrector from the evidence so far.
LearnedCorrection corrector_of(const ControlView& view, const MachineAccess& machine_access,
                               const CaseDescription& compensator, const Evidence& evidence) {
  if (!compensator.plug_in.empty()) {
    if (!compensator.function) machine_access.check_trusted(compensator.plug_in);
    return {plug_in_corrector(view, compensator, evidence.log), {}, {}, {}};
  }
  if (compensator.belief == Kind::Perfect)
    return {machine_access.perfect(view, compensator), {}, {}, {}};
  compensation::MachineBelief belief = machine_belief(view, compensator, evidence);
  LearnedCorrection learned_correction{{}, {}, belief.geometric, {}};
  if (belief.thermal && belief.thermal->held > 0)
    learned_correction.warnings.push_back(fmt::format(
        "thermal belief: {} of {} readings lay outside what it was trained with and were held",
        belief.thermal->held, belief.thermal->time_s.size()));
  if (belief.thermal && view.belief.thermal)
    std::ranges::move(size_warnings(*view.belief.thermal, *belief.thermal),
                      std::back_inserter(learned_correction.warnings));
  const auto corrector = [&](compensation::MachineBelief believed) {
    return belief_corrector(view, compensator, [believed = std::move(believed)](const auto& state) {
      return tool_in_workpiece(believed, state);
    });
  };
  // The part was cut from the datum, so what it showed must not shift the datum.
  if (belief.part) {
    compensation::MachineBelief without_part = belief;
    without_part.part.reset();
    learned_correction.at_datum = corrector(std::move(without_part));
  }
  learned_correction.corrector = corrector(std::move(belief));
  return learned_correction;
}

/// Returns the case; a plug-in has the strategy and channel of the scene.
CaseDescription resolved(const ControlView& view, CaseDescription compensator) {
  if (compensator.plug_in.empty()) return compensator;
  compensator.strategy = view.compensation.plug_in.strategy;
  compensator.channel = view.compensation.plug_in.channel;
  return compensator;
}

}  // namespace

LearnedCorrection learned_correction(const ControlView& view, const MachineAccess& machine_access,
                                     const CaseDescription& described, const Progress& progress) {
  const CaseDescription compensator = resolved(view, described);
  CorrectionLearner learning(view, machine_access, compensator);
  const auto so_far = [&] {
    return corrector_of(view, machine_access, compensator, learning.evidence());
  };
  if (learning.passes() == 0) return so_far();
  Commands commands =
      uncompensated_commands(view.machine, view.path, view.samples, machine_access.touch_off({}));
  // The program runs uncorrected in the first pass, and with the correction so far in later ones.
  for (int pass = 0; pass < learning.passes(); ++pass) {
    if (progress) progress("learn", double(pass) / learning.passes());
    if (pass > 0) commands = deliver_correction(view, machine_access, compensator, so_far());
    learning.read(commands);
    if (!learning.measures(pass)) continue;
    // A part shows the remaining error, so the other beliefs correct it first; otherwise they would
    // be corrected twice.
    if (pass == 0 && learning.has_more_evidence())
      commands = deliver_correction(view, machine_access, compensator, so_far());
    learning.measure_part(commands, pass);
  }
  return so_far();
}

namespace {

/// Calls `answer` and turns its exceptions into an input error that names the compensator.
template <class Answer>
auto fitting(const ControlView& view, const CaseDescription& described, const Answer& answer) {
  const auto refusal = [&](const std::string& found) {
    return BadInput(view.file.string(), 0, 0,
                    "a compensator that fits this program: " + described.name, found);
  };
  try {
    return answer();
  } catch (const std::out_of_range& fault) {  // outside a table of the belief
    throw refusal(fault.what());
  } catch (const std::invalid_argument& fault) {
    throw refusal(fault.what());
  }
}

}  // namespace

Commands compensated(const ControlView& view, const MachineAccess& machine_access,
                     const CaseDescription& described, const Progress& progress) {
  const LearnedCorrection known = fitting(view, described, [&] {
    return learned_correction(view, machine_access, described, progress);
  });
  if (progress) progress("correct", 0.0);
  return compensated(view, machine_access, described, known);
}

Commands compensated(const ControlView& view, const MachineAccess& machine_access,
                     const CaseDescription& described,
                     const LearnedCorrection& learned_correction) {
  return fitting(view, described, [&] {
    return deliver_correction(view, machine_access, resolved(view, described), learned_correction);
  });
}

}  // namespace abbe::sim
