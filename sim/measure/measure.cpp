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
using metrology::Bodies;
using metrology::Readings;

/// The machine of a scene with its heat simulated, shared by all instruments.
struct MeasuredMachine {
  Machine machine;
  Truth truth;
};

MeasuredMachine make_measured_machine(const Scene& scene) {
  Machine machine = compile(scene);
  Truth truth = make_truth(scene, machine, activity(scene, machine, {}, {}));
  truth.actual = machine.nominal;  // the instrument takes the place of tool and part
  return {std::move(machine), std::move(truth)};
}

// Returns the poses of workpiece and tool in the bed, with their deflections under weight.
Bodies bodies_of(const Truth& truth, const AxisState& state) {
  const errors::ForceDeviations all = deviations(truth, state);
  const kinematics::Pose identity = kinematics::Pose::Identity();
  Bodies bodies{truth.actual.workpiece_in_bed(state.q, all.joints),
                truth.actual.tool_in_bed(state.q, all.joints)};
  // The deflections are small displacements in the frames of tool and workpiece.
  if (!all.tool_t.isZero(0.0))
    bodies.T_bt = bodies.T_bt * kinematics::motion(all.tool_t, identity.translation());
  if (!all.workpiece_w.isZero(0.0))
    bodies.T_bw = bodies.T_bw * kinematics::motion(all.workpiece_w, identity.translation());
  return bodies;
}

/// Returns the plans of all starts one after another, with new set-ups for each start.
metrology::Plan plan_of(const InstrumentDescription& description,
                        const kinematics::Chain& nominal) {
  metrology::Plan all;
  for (const double start_s : description.starts_s) {
    metrology::Instrument instrument = description.instrument;
    instrument.start_s = start_s;
    metrology::Plan one = metrology::plan(instrument, nominal);
    const double ended_s =
        all.measurements.empty() ? start_s : all.measurements.back().state.time_s;
    // a machine can do one measurement at a time
    if (start_s < ended_s)
      throw std::invalid_argument(
          fmt::format("a start at {:.2f} h while the readings before it last until {:.2f} h",
                      start_s / 3600.0, ended_s / 3600.0));
    const int before = int(all.set_ups.size());
    for (metrology::SetUp& set_up : one.set_ups) all.set_ups.push_back(std::move(set_up));
    for (metrology::Measurement& measurement : one.measurements) {
      measurement.set_up += before;
      all.measurements.push_back(std::move(measurement));
    }
    all.instrument = one.instrument;
    all.kind = one.kind;
    all.duration_s += one.duration_s;
  }
  return all;
}

/// Logs the temperatures of the readings. Sensors have a lag and need times that do not decrease,
/// while the order of an instrument may go back in time.
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

Readings read_by(const InstrumentDescription& description, const Scene& scene,
                 const MeasuredMachine& subject) {
  const auto& [machine, truth] = subject;
  const std::string& name = description.instrument.name;
  try {
    Readings readings = metrology::measure(
        // a set of readings may take minutes, so an interrupt is checked at each reading
        plan_of(description, machine.nominal), machine.nominal,
        [&truth = truth](const AxisState& state) {
          stop_if_interrupted();
          return bodies_of(truth, state);
        },
        fnv_1a(name, scene.seed));
    log_temperatures(readings, scene, truth);
    return readings;
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a machine that " + name + " can measure",
                   fault.what());
  } catch (const std::out_of_range& fault) {
    throw BadInput(scene.file.string(), 0, 0, "errors that reach where " + name + " measures",
                   fault.what());
  }
}

/// Returns the judged, cut surface of a case in the workpiece.
metrology::PartSurface surface_of(const Job& job, const Cut& cut) {
  const auto& status = cut.surface.status;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < status.size(); ++i)
    if (status[i] == cutting::VertexStatus::Cut && job.design_w.judged[i])
      rows.push_back(Eigen::Index(i));
  return {job.design_w.vertices(rows, Eigen::all), job.design_w.normals(rows, Eigen::all),
          cut.surface.residual(rows)};
}

/// Returns about one point per square of the spacing, distributed as the vertices are.
metrology::PartSurface thinned(const metrology::PartSurface& part, double spacing, double area) {
  // three points at least, as a plane needs
  const double wanted = std::max(3.0, area / (spacing * spacing));
  const auto every =
      std::max<Eigen::Index>(1, Eigen::Index(double(part.deviation.size()) / wanted));
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = every / 2; i < part.deviation.size(); i += every) rows.push_back(i);
  return {part.points_w(rows, Eigen::all), part.normals_w(rows, Eigen::all), part.deviation(rows)};
}

// The part stays clamped as it was cut. The probe takes the place of the tool, and the control
// measures from the datum from which it cut.
metrology::PartReadings probed(const Job& job, const metrology::PartSurface& part,
                               metrology::TouchProbe probe) {
  Truth truth = job.truth;
  truth.actual = kinematics::Chain(job.truth.actual.joints(), job.truth.actual.T_bw_home(),
                                   job.machine.nominal.T_bt_home());
  // the probe starts when the program has ended
  if (!job.samples.states.empty()) probe.start_s += job.samples.states.back().time_s;
  const Eigen::Vector3d datum_w = control_datum_offset(job);
  // Shifting the commanded points by the datum shift, and the deviation back by its normal
  // component, makes the control measure relative to its own datum.
  metrology::PartSurface commanded = part;
  commanded.points_w.rowwise() += datum_w.transpose();
  commanded.deviation -= part.normals_w * datum_w;
  metrology::PartReadings readings = metrology::probe(
      commanded, job.machine.nominal,
      [&](const AxisState& state) { return bodies_of(truth, state); }, probe);
  readings.points_w = part.points_w;  // every point was cut, so every one was read
  return readings;
}

/// Throws BadInput if the surface has no readable point.
void check_readable(const Job& job, const Cut& cut, const metrology::PartSurface& part,
                    const std::string& instrument) {
  if (part.deviation.size() > 0) return;
  throw BadInput(job.scene.file.string(), 0, 0, "a part that " + instrument + " can measure",
                 fmt::format("none of its judged surface cut within {} mm of the design, {} "
                             "vertices gouged deeper",
                             job.scene.band, cut.surface.gouges.size()));
}

/// Returns the location of an instrument's table in the scene; empty if the instrument was only
/// typed by the user.
Place place_of_instrument(const Scene& scene, const std::string& name) {
  const Node* list = scene.tree ? scene.tree->find("instrument") : nullptr;
  if (!list || !list->array()) return {};
  for (const Node& one : *list->array()) {
    const Node* own = one.find("name") ? one.find("name") : one.find("kind");
    if (own && own->text() && *own->text() == name) return one.place;
  }
  return {};
}

}  // namespace

std::optional<PartInstrumentDescription> find_part_instrument(const Scene& scene,
                                                              const std::string& name) {
  for (const PartInstrumentDescription& one : scene.part_instruments)
    if (one.name == name) return one;
  for (const InstrumentDescription& one : scene.instruments)
    if (one.instrument.name == name) return std::nullopt;
  // kinds that are not in the scene have typical figures
  if (name == "cmm") return PartInstrumentDescription{name, "", metrology::CoordinateMachine{}};
  if (name != "touch_probe") return std::nullopt;
  metrology::TouchProbe probe;
  probe.q = kinematics::AxisVector::Zero(Eigen::Index(scene.machine.joints.size()));
  return PartInstrumentDescription{name, "", probe};
}

PartReadingsFile measured_part(const Job& job, const Cut& cut,
                               const PartInstrumentDescription& instrument) {
  const Scene& scene = job.scene;
  const metrology::PartSurface part = surface_of(job, cut);
  check_readable(job, cut, part, instrument.name);
  // Noise depends on the seed and the name, so that a new instrument does not change the others.
  const std::uint64_t seed = fnv_1a(instrument.name, scene.seed);
  PartReadingsFile file{instrument.name, "cmm", scene.title, {}};
  if (!instrument.case_name.empty()) file.part += ", " + instrument.case_name;
  try {
    if (auto machine = std::get_if<metrology::CoordinateMachine>(&instrument.how)) {
      metrology::CoordinateMachine options = *machine;
      options.spacing = instrument.spacing;
      options.seed = seed;
      file.readings = metrology::measure_coordinates(part, options);
    } else {
      metrology::TouchProbe options = std::get<metrology::TouchProbe>(instrument.how);
      options.seed = seed;
      file.kind = "touch_probe";
      file.readings =
          probed(job, thinned(part, instrument.spacing, job.design_w.area.sum()), options);
    }
  } catch (const std::invalid_argument& fault) {
    const Place place = place_of_instrument(scene, instrument.name);
    throw BadInput(place.file ? *place.file : scene.file.string(), place.line, place.column,
                   "a part that " + instrument.name + " can measure", fault.what());
  }
  return file;
}

InstrumentDescription find_instrument(const Scene& scene, const std::string& name) {
  for (const InstrumentDescription& one : scene.instruments)
    if (one.instrument.name == name) return one;
  if (const auto kind = metrology::kind_of(name)) return {metrology::typical(*kind), {0.0}};
  std::set<std::string> known{"cmm", "touch_probe"};
  for (const InstrumentDescription& one : scene.instruments) known.insert(one.instrument.name);
  for (const metrology::Kind kind : metrology::all_kinds())
    known.insert(metrology::to_string(kind));
  std::string list;
  for (const std::string& one : known) list += (list.empty() ? "" : ", ") + one;
  const auto meant = nearest(name, known);
  throw BadInput(scene.file.string(), 0, 0, "an instrument of the scene or a kind (" + list + ")",
                 "\"" + name + "\"" + (meant ? " (did you mean " + *meant + "?)" : ""));
}

std::vector<Readings> measured(const Scene& scene,
                               const std::vector<InstrumentDescription>& descriptions) {
  std::vector<Readings> all;
  if (descriptions.empty()) return all;
  const MeasuredMachine subject = make_measured_machine(scene);
  for (const InstrumentDescription& one : descriptions) all.push_back(read_by(one, scene, subject));
  return all;
}

Readings measured(const Scene& scene, const InstrumentDescription& description) {
  return measured(scene, std::vector{description}).front();
}

}  // namespace abbe::sim
