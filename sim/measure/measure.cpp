#include "sim/measure/measure.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/hash.h"
#include "sim/cut/commands.h"
#include "sim/cut/process.h"
#include "sim/files/progress.h"
#include "sim/machine/truth.h"
#include "sim/readings/readings_file.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {
namespace {

namespace metrology = errors::metrology;
using kinematics::AxisState;
using metrology::BodyPoses;
using metrology::Readings;

/// The machine of a scene and its simulated heat, shared by all instruments.
struct MeasuredMachine {
  Machine machine;
  Truth truth;
};

MeasuredMachine simulate_machine(const Scene& scene) {
  Machine machine = make_machine(scene);
  Truth truth = make_truth(scene, machine, activity(scene, machine, {}, {}));
  truth.actual = machine.nominal;  // the instrument replaces tool and part
  return {std::move(machine), std::move(truth)};
}

/// Returns the poses of workpiece and tool in the bed, with their deflections under weight.
BodyPoses body_poses(const Truth& truth, const AxisState& state) {
  const errors::ForceDeviations sums = deviations(truth, state);
  const Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  BodyPoses bodies{truth.actual.workpiece_in_bed(state.q, sums.joints),
                   truth.actual.tool_in_bed(state.q, sums.joints)};
  // The deflections are small displacements in the frames of tool and workpiece.
  if (!sums.tool_t.isZero(0.0)) bodies.T_bt = bodies.T_bt * kinematics::motion(sums.tool_t, origin);
  if (!sums.workpiece_w.isZero(0.0))
    bodies.T_bw = bodies.T_bw * kinematics::motion(sums.workpiece_w, origin);
  return bodies;
}

/// Returns the plans of all starts joined in chronological order, with new set-ups for each start.
/// @throws std::invalid_argument if a start is before the end of the readings of the previous one
metrology::Plan combined_plan(const InstrumentDescription& description,
                              const kinematics::Chain& nominal) {
  metrology::Plan combined;
  for (const double start_s : description.starts_s) {
    metrology::Instrument instrument = description.instrument;
    instrument.start_s = start_s;
    metrology::Plan start_plan = metrology::plan(instrument, nominal);
    const double previous_end_s =
        combined.measurements.empty() ? start_s : combined.measurements.back().state.time_s;
    // A machine can make only one measurement at a time.
    if (start_s < previous_end_s)
      throw std::invalid_argument(
          fmt::format("a start at {:.2f} h although the previous readings last until {:.2f} h",
                      start_s / 3600.0, previous_end_s / 3600.0));
    const int set_up_count = int(combined.set_ups.size());
    for (metrology::SetUp& set_up : start_plan.set_ups)
      combined.set_ups.push_back(std::move(set_up));
    for (metrology::Measurement& measurement : start_plan.measurements) {
      measurement.set_up += set_up_count;
      combined.measurements.push_back(std::move(measurement));
    }
    combined.instrument = start_plan.instrument;
    combined.kind = start_plan.kind;
    combined.duration_s += start_plan.duration_s;
  }
  return combined;
}

/// Adds the readings of the temperature sensors. Sensors have a lag and need times that do not
/// decrease, whereas the readings of an instrument may not be in chronological order.
void log_temperatures(Readings& readings, const Scene& scene, const Truth& truth) {
  if (!scene.thermal || !truth.heat) return;
  const auto& measurements = readings.plan.measurements;
  std::vector<Eigen::Index> order(measurements.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = Eigen::Index(i);
  const auto time = [&](Eigen::Index i) { return measurements[std::size_t(i)].state.time_s; };
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return time(a) < time(b); });
  Eigen::VectorXd times(Eigen::Index(measurements.size()));
  for (Eigen::Index i = 0; i < times.size(); ++i) times[i] = time(order[std::size_t(i)]);
  const auto& sensors = scene.thermal->sensors;
  readings.T_C.resize(times.size(), Eigen::Index(sensors.size()));
  for (std::size_t k = 0; k < sensors.size(); ++k) {
    readings.sensors.push_back(sensors[k].name);
    const Eigen::VectorXd T_C = errors::readings(sensors[k], truth.heat->run, times);
    for (Eigen::Index i = 0; i < times.size(); ++i)
      readings.T_C(order[std::size_t(i)], Eigen::Index(k)) = T_C[i];
  }
}

/// Returns the readings of one instrument on the simulated machine.
Readings read_instrument(const InstrumentDescription& description, const Scene& scene,
                         const MeasuredMachine& subject) {
  const auto& [machine, truth] = subject;
  const std::string& name = description.instrument.name;
  try {
    Readings readings = metrology::measure(
        // A set of readings may take minutes, so each reading checks for an interrupt.
        combined_plan(description, machine.nominal), machine.nominal,
        [&truth = truth](const AxisState& state) {
          stop_if_interrupted();
          return body_poses(truth, state);
        },
        fnv_1a(name, scene.seed));
    log_temperatures(readings, scene, truth);
    return readings;
  } catch (const std::invalid_argument& error) {
    throw BadInput(scene.file.string(), 0, 0, "a machine that " + name + " can measure",
                   error.what());
  } catch (const std::out_of_range& error) {
    throw BadInput(scene.file.string(), 0, 0, "errors that are defined where " + name + " measures",
                   error.what());
  }
}

/// Returns the evaluated part of the cut surface, in the workpiece.
metrology::PartSurface cut_surface(const Job& job, const Cut& cut) {
  const auto& status = cut.surface.status;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < status.size(); ++i)
    if (status[i] == cutting::VertexStatus::Cut && job.design_w.judged[i])
      rows.push_back(Eigen::Index(i));
  return {job.design_w.vertices(rows, Eigen::all), job.design_w.normals(rows, Eigen::all),
          cut.surface.residual(rows)};
}

/// Returns about one point per square with sides of the spacing, distributed like the vertices.
metrology::PartSurface thin_points(const metrology::PartSurface& surface, double spacing,
                                   double area) {
  // At least three points, as required by a plane.
  const double point_count = std::max(3.0, area / (spacing * spacing));
  const auto stride =
      std::max<Eigen::Index>(1, Eigen::Index(double(surface.deviation.size()) / point_count));
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = stride / 2; i < surface.deviation.size(); i += stride) rows.push_back(i);
  return {surface.points_w(rows, Eigen::all), surface.normals_w(rows, Eigen::all),
          surface.deviation(rows)};
}

/// Returns the readings of a touch probe on the part, which is still clamped. The probe replaces
/// the tool, and the control measures relative to the datum of the cut.
metrology::PartReadings probe_part(const Job& job, const metrology::PartSurface& surface,
                                   metrology::TouchProbe probe) {
  Truth truth = job.truth;
  truth.actual = kinematics::Chain(job.truth.actual.joints(), job.truth.actual.T_bw_home(),
                                   job.machine.nominal.T_bt_home());
  // The probe starts at the end of the program.
  if (!job.samples.states.empty()) probe.start_s += job.samples.states.back().time_s;
  const Eigen::Vector3d datum_w = control_datum_offset(job);
  // Shifting the commanded points by the datum shift, and the deviation back by its normal
  // component, makes the control measure relative to its own datum.
  metrology::PartSurface commanded = surface;
  commanded.points_w.rowwise() += datum_w.transpose();
  commanded.deviation -= surface.normals_w * datum_w;
  metrology::PartReadings readings = metrology::probe(
      commanded, job.machine.nominal,
      [&](const AxisState& state) { return body_poses(truth, state); }, probe);
  readings.points_w = surface.points_w;  // every point was cut, so the probe has read each one
  return readings;
}

/// Throws BadInput if the surface has no readable point.
void check_readable(const Job& job, const Cut& cut, const metrology::PartSurface& surface,
                    const std::string& instrument) {
  if (surface.deviation.size() > 0) return;
  throw BadInput(
      job.scene.file.string(), 0, 0, "a part that " + instrument + " can measure",
      fmt::format("no judged surface cut within {} mm of the design, {} vertices gouged deeper",
                  job.scene.band, cut.surface.gouges.size()));
}

/// Returns the location of an instrument's table in the scene; empty if the instrument is given
/// only on the command line.
SourcePosition instrument_location(const Scene& scene, const std::string& name) {
  const Node* list = scene.tree ? scene.tree->find("instrument") : nullptr;
  if (!list || !list->array()) return {};
  for (const Node& instrument : *list->array()) {
    const Node* name_node =
        instrument.find("name") ? instrument.find("name") : instrument.find("kind");
    if (name_node && name_node->text() && *name_node->text() == name) return instrument.position;
  }
  return {};
}

}  // namespace

std::optional<PartInstrumentDescription> find_part_instrument(const Scene& scene,
                                                              const std::string& name) {
  for (const PartInstrumentDescription& description : scene.part_instruments)
    if (description.name == name) return description;
  for (const InstrumentDescription& description : scene.instruments)
    if (description.instrument.name == name) return std::nullopt;
  // Kinds that are not in the scene get typical values.
  if (name == "cmm")
    return PartInstrumentDescription{name, "", metrology::CoordinateMeasuringMachine{}};
  if (name != "touch_probe") return std::nullopt;
  metrology::TouchProbe probe;
  probe.q = kinematics::AxisVector::Zero(Eigen::Index(scene.machine.joints.size()));
  return PartInstrumentDescription{name, "", probe};
}

PartReadingsFile measure_cut_part(const Job& job, const Cut& cut,
                                  const PartInstrumentDescription& instrument) {
  const Scene& scene = job.scene;
  const metrology::PartSurface surface = cut_surface(job, cut);
  check_readable(job, cut, surface, instrument.name);
  // Noise depends on the seed and the name, so that a new instrument does not change the others.
  const std::uint64_t seed = fnv_1a(instrument.name, scene.seed);
  PartReadingsFile file{instrument.name, "cmm", scene.title, {}};
  if (!instrument.case_name.empty()) file.part += ", " + instrument.case_name;
  try {
    if (const auto* device =
            std::get_if<metrology::CoordinateMeasuringMachine>(&instrument.device)) {
      metrology::CoordinateMeasuringMachine cmm = *device;
      cmm.spacing = instrument.spacing;
      cmm.seed = seed;
      file.readings = metrology::measure_coordinates(surface, cmm);
    } else {
      metrology::TouchProbe probe = std::get<metrology::TouchProbe>(instrument.device);
      probe.seed = seed;
      file.kind = "touch_probe";
      file.readings =
          probe_part(job, thin_points(surface, instrument.spacing, job.design_w.area.sum()), probe);
    }
  } catch (const std::invalid_argument& error) {
    const SourcePosition location = instrument_location(scene, instrument.name);
    throw BadInput(location.file ? *location.file : scene.file.string(), location.line,
                   location.column, "a part that " + instrument.name + " can measure",
                   error.what());
  }
  return file;
}

InstrumentDescription find_instrument(const Scene& scene, const std::string& name) {
  for (const InstrumentDescription& description : scene.instruments)
    if (description.instrument.name == name) return description;
  if (const auto kind = metrology::find_kind(name))
    return {metrology::typical_instrument(*kind), {0.0}};
  std::set<std::string> known{"cmm", "touch_probe"};
  for (const InstrumentDescription& description : scene.instruments)
    known.insert(description.instrument.name);
  for (const metrology::Kind kind : metrology::all_kinds())
    known.insert(metrology::to_string(kind));
  std::string known_names;
  for (const std::string& known_name : known)
    known_names += (known_names.empty() ? "" : ", ") + known_name;
  const auto suggestion = nearest(name, known);
  throw BadInput(scene.file.string(), 0, 0,
                 "an instrument of the scene or a kind (" + known_names + ")",
                 "\"" + name + "\"" + (suggestion ? " (did you mean " + *suggestion + "?)" : ""));
}

std::vector<Readings> measure_machine(const Scene& scene,
                                      const std::vector<InstrumentDescription>& descriptions) {
  std::vector<Readings> result;
  if (descriptions.empty()) return result;
  const MeasuredMachine subject = simulate_machine(scene);
  for (const InstrumentDescription& description : descriptions)
    result.push_back(read_instrument(description, scene, subject));
  return result;
}

Readings measure_machine(const Scene& scene, const InstrumentDescription& description) {
  return measure_machine(scene, std::vector{description}).front();
}

}  // namespace abbe::sim
