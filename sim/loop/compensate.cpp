#include "sim/loop/compensate.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "sim/cut/datum.h"
#include "sim/cut/part.h"
#include "sim/cut/stopwatch.h"
#include "sim/loop/beliefs.h"
#include "sim/loop/correctors.h"
#include "sim/loop/program_channel.h"
#include "sim/loop/real_time.h"
#include "sim/measure/measure.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;
using Channel = CaseDescription::Channel;
using Kind = CaseDescription::Belief;

/// What a corrector is asked: commands, and where each should bring the tool.
struct Aim {
  std::vector<AxisState> commanded;
  std::vector<Pose> T_wt;
};

/// The program with the datum found while the corrector acts. A perfect belief knows where the tool
/// should be; any other only where it should be from the datum.
Aim aim(const Job& job, const Corrector& at_datum, bool absolute) {
  if (absolute) return {told(job, job.path, job.samples, job.machine.nominal), job.T_wt_nominal};
  const auto commands_at = [&](const Eigen::Vector3d& offset_w) {
    return told(job, job.path, job.samples, job.machine.nominal, offset_w);
  };
  Aim result{commands_at(Eigen::Vector3d::Zero()), job.T_wt_nominal};
  const Eigen::Vector3d offset_w = datum_offset(job.scene.datum, job.machine, job.truth, at_datum);
  if (offset_w.isZero(0.0)) return result;
  std::vector<AxisState> shifted = commands_at(offset_w);
  const kinematics::Chain& control = job.machine.control;
  tbb::parallel_for(std::size_t(0), shifted.size(), [&](std::size_t i) {
    const Pose from = control.tool_in_workpiece(result.commanded[i].q);
    result.T_wt[i] = control.tool_in_workpiece(shifted[i].q) * from.inverse() * result.T_wt[i];
  });
  result.commanded = std::move(shifted);
  return result;
}

/// Corrections brought to the machine.
Compensated delivered(const Job& job, const CaseDescription& compensator, Learnt learnt) {
  if (compensator.channel == Channel::Table) {
    TableCorrector tables = table_corrector(job, learnt.corrector, learnt.geometric);
    learnt.corrector = std::move(tables.corrector);
    learnt.at_datum = {};  // tables act always
    for (const std::string& one : tables.left_out) learnt.warnings.push_back("table: " + one);
  }
  const Corrector& corrector = learnt.corrector;
  const Corrector& at_datum = learnt.at_datum ? learnt.at_datum : corrector;
  // tables act while the datum is found, whoever filled them
  const bool absolute = compensator.plug_in.empty() && compensator.belief == Kind::Perfect &&
                        compensator.channel != Channel::Table;
  Compensated result;
  if (compensator.channel == Channel::Program) {
    result = through_program(job, corrector,
                             absolute ? datum_offset(job.scene.datum, job.machine, job.truth)
                                      : expected_offset(job.scene.datum, job.machine, at_datum));
  } else {
    const Aim asked = aim(job, at_datum, absolute);
    Corrected ideal = corrector(asked.commanded, asked.T_wt);
    if (compensator.channel == Channel::Ideal || compensator.channel == Channel::Table) {
      result.samples = job.samples;
      if (compensator.channel == Channel::Table)
        for (std::size_t i = 0; i < ideal.states.size(); ++i)
          result.correction.push_back(ideal.states[i].q - asked.commanded[i].q);
      result.samples.states = std::move(ideal.states);
    } else {
      result = through_time(job, compensator.channel, asked.commanded, ideal.states);
    }
    result.point_left = ideal.point_left;
    result.direction_left = ideal.direction_left;
    result.not_converged = ideal.not_converged;
  }
  result.warnings = std::move(learnt.warnings);
  return result;
}

/// The cut as the compensator computes it: on the machine that it believes in, with commands as
/// they were corrected so far.
compensation::LoadCourse computed_load(const Job& job, const Compensated& told,
                                       compensation::MachineBelief believed) {
  const Scene& scene = job.scene;
  believed.force = {errors::bind(scene.belief.force->compliance, job.machine.control), {}};
  const auto& T_wt = told.T_wt_nominal.empty() ? job.T_wt_nominal : told.T_wt_nominal;
  const auto pose = [&](std::size_t i, const errors::Load& load) {
    Pose tool = tool_in_workpiece(believed, told.samples.states[i], load);
    if (told.piezo)
      tool.translation() +=
          told.piezo->stroke[Eigen::Index(i)] * (tool.linear() * told.piezo->piezo.direction_t);
    return tool;
  };
  const Process process =
      follow(scene, job.machine, cutting::transformed(job.design_w, scene.part.T_wm.inverse()),
             {told.samples, told.path ? *told.path : job.path, T_wt, pose, job.machine.control,
              scene.tool.nominal});
  compensation::LoadCourse course{Eigen::VectorXd(Eigen::Index(process.steps.size())), {}};
  for (std::size_t i = 0; i < process.steps.size(); ++i) {
    course.time_s[Eigen::Index(i)] = process.steps[i].time_s;
    course.loads.push_back(process.steps[i].load);
  }
  return course;
}

/// What is learnt while a compensator runs its passes.
class Learning {
 public:
  Learning(const Job& job, const CaseDescription& compensator);

  int passes() const { return passes_; }
  const Evidence& evidence() const { return evidence_; }
  /// Runs what was commanded so far and learns from what the control reads.
  void read(const Compensated& told);
  /// Cuts what was commanded so far, measures the part and learns from it.
  void measure_part(const Compensated& told, int pass);
  bool measures(int pass) const;
  /// Whether there is something else to believe than the part.
  bool knows_more() const;

 private:
  bool wants(Kind kind) const { return believes(job_.scene, compensator_.belief, kind); }

  const Job& job_;
  const CaseDescription& compensator_;
  int passes_ = 0;
  Evidence evidence_;
  std::optional<cutting::Surface> error_free_;
  Eigen::VectorXd total_;  ///< (vertices) mm, deviation by all readings so far
};

Learning::Learning(const Job& job, const CaseDescription& compensator)
    : job_(job), compensator_(compensator) {
  if (!compensator.plug_in.empty()) {
    passes_ = 1;  // it is given what was read while the program ran uncorrected
    return;
  }
  const BeliefDescription& given = job.scene.belief;
  if (wants(Kind::Thermal)) passes_ = 1;
  if (wants(Kind::Force) && given.force) passes_ = std::max(passes_, given.force->passes);
  if (wants(Kind::Part) && given.part) passes_ = std::max(passes_, given.part->passes);
}

bool Learning::measures(int pass) const {
  const BeliefDescription& given = job_.scene.belief;
  return compensator_.plug_in.empty() && wants(Kind::Part) && given.part &&
         pass < given.part->passes;
}

bool Learning::knows_more() const {
  return wants(Kind::Identified) || wants(Kind::Thermal) || wants(Kind::Force);
}

void Learning::read(const Compensated& told) {
  using From = BeliefDescription::Force::From;
  const BeliefDescription& given = job_.scene.belief;
  const bool plugged = !compensator_.plug_in.empty();
  const bool force = !plugged && wants(Kind::Force) && given.force;
  const bool reads_force =
      (force && given.force->from != From::Model) || (plugged && job_.scene.cutting);
  if (reads_force)
    evidence_.log = control_log(job_, told, cut_process(job_, told));
  else if (plugged || wants(Kind::Thermal))
    evidence_.log = control_log(job_, told, {});
  if (!force) return;
  if (given.force->from == From::Current && !evidence_.law)
    evidence_.law = trained_law(*given.force, job_.scene.trusted);
  // by what is believed besides, so after the log
  if (given.force->from == From::Model)
    evidence_.model_load = computed_load(job_, told, machine_belief(job_, compensator_, evidence_));
}

void Learning::measure_part(const Compensated& told, int pass) {
  const Scene& scene = job_.scene;
  auto instrument = part_instrument_of(scene, scene.belief.part->instrument);
  if (!instrument)
    throw BadInput(scene.file.string(), 0, 0, "an [[instrument]] that measures the part",
                   "\"" + scene.belief.part->instrument + "\"");
  instrument->name += fmt::format(" {}", pass + 1);
  if (!error_free_) error_free_ = cut_error_free(job_).surface;
  const Cut made = cut(job_, told);
  const errors::metrology::PartReadings readings = measured_part(job_, made, *instrument).readings;
  // cusps are meant, and no correction of the tool takes them away
  const Eigen::VectorXd unmeant =
      readings.deviation - left_by_program(job_, *error_free_, readings.points_w);
  const Eigen::VectorXd here = compensation::between_readings(
      readings.points_w, unmeant, job_.design_w.vertices, 5.0 * instrument->spacing);
  total_ = total_.size() == 0 ? here : Eigen::VectorXd(total_ + here);
  evidence_.part = course_of_part(job_, *error_free_, total_);
}

/// The steps of a cut without its stock.
Process steps_of(const Process& process) { return {process.steps, {}, {}, {}}; }

/// A perfect belief knows what its own corrections do: the program says at first how the masses
/// press and the rigid machine how the cut does, then the corrected commands say it, each time by
/// some hundredths of before.
Corrector perfect_corrector(const Job& job, const CaseDescription& compensator) {
  constexpr int rounds = 3;
  Foreseen run{steps_of(job.nominal_process), job.accelerations};
  Corrector corrector = belief_corrector(job, compensator, perfect_belief(job, run));
  const bool bends = job.truth.compliance && !job.nominal_process.steps.empty();
  const bool presses = !job.accelerations.empty();
  if (!bends && !presses) return corrector;
  Compensated told = as_programmed(job);
  const std::vector<AxisState> commanded = told.samples.states;
  for (int round = presses ? 0 : rounds - 1; round < rounds; ++round) {
    told.samples.states = corrector(commanded, job.T_wt_nominal).states;
    if (presses) run.accelerations = accelerations(told.samples);
    // the stock is dear, so the cut is followed once, with the commands nearly as they will be
    if (bends && round + 1 == rounds) run.process = steps_of(cut_process(job, told));
    corrector = belief_corrector(job, compensator, perfect_belief(job, run));
  }
  return corrector;
}

/// What corrects, by what is known so far.
Learnt corrector_of(const Job& job, const CaseDescription& compensator, const Evidence& evidence) {
  if (!compensator.plug_in.empty())
    return {plug_in_corrector(job, compensator, evidence.log), {}, {}, {}};
  if (compensator.belief == Kind::Perfect) return {perfect_corrector(job, compensator), {}, {}, {}};
  compensation::MachineBelief belief = machine_belief(job, compensator, evidence);
  Learnt learnt{{}, {}, belief.geometric, {}};
  if (belief.thermal && belief.thermal->held > 0)
    learnt.warnings.push_back(fmt::format(
        "thermal belief: {} of {} readings lay outside what it was trained with and were held",
        belief.thermal->held, belief.thermal->time_s.size()));
  const auto corrector = [&](compensation::MachineBelief believed) {
    return belief_corrector(job, compensator, [believed = std::move(believed)](const auto& state) {
      return tool_in_workpiece(believed, state);
    });
  };
  if (belief.part) {
    compensation::MachineBelief without_part = belief;
    without_part.part.reset();
    learnt.at_datum = corrector(std::move(without_part));
  }
  learnt.corrector = corrector(std::move(belief));
  return learnt;
}

/// A plug-in's strategy and channel are those of the scene.
CaseDescription resolved(const Job& job, CaseDescription compensator) {
  if (compensator.plug_in.empty()) return compensator;
  compensator.strategy = job.scene.compensation.plug_in.strategy;
  compensator.channel = job.scene.compensation.plug_in.channel;
  return compensator;
}

}  // namespace

Learnt learnt(const Job& job, const CaseDescription& described, const Progress& progress) {
  const CaseDescription compensator = resolved(job, described);
  Learning learning(job, compensator);
  Compensated told = as_programmed(job);
  for (int pass = 0; pass < learning.passes(); ++pass) {
    if (progress) progress("learn", double(pass) / learning.passes());
    if (pass > 0)
      told = delivered(job, compensator, corrector_of(job, compensator, learning.evidence()));
    learning.read(told);
    if (!learning.measures(pass)) continue;
    // a part shows what is left: of what else is believed nothing shall be corrected twice
    if (pass == 0 && learning.knows_more())
      told = delivered(job, compensator, corrector_of(job, compensator, learning.evidence()));
    learning.measure_part(told, pass);
  }
  return corrector_of(job, compensator, learning.evidence());
}

Compensated compensate(const Job& job, const CaseDescription& described, const Progress& progress) {
  const auto refuse = [&](const std::string& seen) {
    throw BadInput(job.scene.file.string(), 0, 0,
                   "a compensator that fits this program: " + described.name, seen);
  };
  try {
    return delivered(job, resolved(job, described), learnt(job, described, progress));
  } catch (const std::out_of_range& fault) {  // a table of the belief is left
    refuse(fault.what());
  } catch (const std::invalid_argument& fault) {
    refuse(fault.what());
  }
  return {};
}

Cut cut(const Job& job, const std::optional<CaseDescription>& compensator,
        const Progress& progress) {
  if (!compensator) return cut(job, progress);
  Stopwatch watch;
  const Compensated told = compensate(job, *compensator, progress);
  const double correction_s = watch.lap();
  Cut result = cut(job, told, progress);
  result.name = result.case_name = compensator->name;
  if (!compensator->plug_in.empty()) result.case_name = compensator->plug_in.string();
  result.timing_s["correction"] = correction_s;
  return result;
}

}  // namespace abbe::sim
