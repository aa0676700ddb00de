#pragma once

#include <map>
#include <ostream>
#include <sstream>
#include <string>

#include "sim/scene/scene.h"

/// All that a scene says but where it came from, as text with every bit of every number: two scenes
/// are equal if their texts are.
namespace abbe::sim {

class Fingerprint {
 public:
  explicit Fingerprint(const Scene& scene) {
    out_ << std::hexfloat;
    put("title", scene.title);
    put("seed", scene.seed);
    put("machine", scene.machine.name);
    for (const auto& joint : scene.machine.joints) put(joint);
    put("T_bw", scene.machine.T_bw.matrix());
    put("T_bs", scene.machine.T_bs.matrix());
    put("rapid", scene.machine.rapid_speed);
    put("rapid_turn", scene.machine.rapid_turn);
    put("home", scene.machine.home);
    put("scale", scene.error_scale);
    put(scene.geometric);
    if (scene.thermal) put(*scene.thermal);
    if (scene.compliance) put(*scene.compliance);
    for (const auto& vibration : scene.vibrations) put(vibration);
    if (scene.cutting) put(*scene.cutting);
    put(scene.signals);
    for (const auto& one : scene.instruments) put(one);
    for (const auto& one : scene.part_instruments) put(one);
    if (scene.sensor_choice) put(*scene.sensor_choice);
    put("setup", scene.setup);
    put(scene.tool);
    put(scene.part);
    put(scene.program);
    for (const auto& joint : scene.control.joints) put(joint);
    put("control.tool_length", scene.control.tool_length);
    put(scene.datum);
    put("alignment", int(scene.alignment));
    put("chord", scene.chord_tolerance);
    put("step", scene.max_step);
    put("band", scene.band);
    put("from", scene.view.from);
    put("up", scene.view.up);
    put("range", scene.view.range_um);
    put("pv", scene.limits.pv_um);
    put("rms", scene.limits.rms_um);
    put("max_abs", scene.limits.max_abs_um);
    put(scene.belief);
    put(scene.compensation);
    put("case to cut", scene.case_name);
    for (const auto& one : scene.cases) put(one);
    for (const auto& variant : scene.variants) {
      put("variant", variant.name);
      // a resolved text has plain keys before tables; the order means nothing
      std::multimap<std::string, std::string> set;
      for (const Override& one : variant.set) set.emplace(one.path, one.value);
      for (const auto& [path, value] : set) put(path, value);
    }
  }

  std::string text() const { return out_.str(); }

 private:
  template <typename T>
  void put(const std::string& name, const T& value) {
    out_ << name << ": " << value << "\n";
  }
  template <typename T>
  void put(const std::string& name, const std::optional<T>& value) {
    out_ << name << ": ";
    if (value) out_ << *value;
    out_ << "\n";
  }
  void put(const kinematics::Joint& joint) {
    put("joint", joint.name);
    put("side", int(joint.side));
    put("motion", int(joint.motion));
    put("direction", joint.direction_b);
    put("point", joint.point_b);
    put("min", joint.min);
    put("max", joint.max);
    put("axes", int(joint.deviation_axes));
    put("squareness", int(joint.squareness));
  }
  void put(const errors::Element& element) {
    put("element", errors::to_string(element.name));
    for (const auto& curve : element.curves) {
      put("curve", curve.name);
      put("argument", int(curve.argument));
      put("negate", curve.negate);
      put("scale", curve.scale);
      put("shape", curve.shape.index());
      std::visit([&](const auto& shape) { put(shape); }, curve.shape);
    }
  }
  void put(const errors::GeometricErrors& geometric) {
    for (const auto& element : geometric.elements) put(element);
    for (const auto& line : geometric.measuring_lines) {
      put(std::string("line ") + line.axis, line.at_b);
      put("by", int(line.by));
    }
    put(geometric.covariance);
  }
  void put(const errors::Covariance& covariance) {
    for (const auto& one : covariance.of) {
      put("covariance of", one.element);
      put("curve", one.curve);
      put("number", one.number);
    }
    put("covariance", covariance.matrix);
  }
  void put(const errors::Constant& c) { put("value", c.value); }
  void put(const errors::Polynomial& p) {
    put("c", p.c);
    put("centre", p.centre);
    put("half", p.half_range);
  }
  void put(const errors::Legendre& p) {
    put("c", p.c);
    put("centre", p.centre);
    put("half", p.half_range);
  }
  void put(const errors::Fourier& f) {
    put("a", f.a);
    put("b", f.b);
    put("period", f.period);
  }
  void put(const errors::Table& t) {
    put("q", t.q);
    put("value", t.value);
    put("between", int(t.between));
    put("outside", int(t.outside));
  }
  void put(const errors::Backlash& b) { put("half", b.half); }
  void put(const errors::UpDown& u) {
    put(u.up);
    put(u.down);
  }
  void put(const errors::Asynchronous& a) {
    put("rms", a.rms);
    put("seed", a.seed);
    put("lowest_order", a.lowest_order);
    put("highest_order", a.highest_order);
  }
  void put(const errors::Repeatability& r) {
    put("sigma", r.sigma);
    put("seed", r.seed);
  }
  void put(const cutting::Cutter& c) {
    put("radius", c.radius);
    put("corner", c.corner_radius);
    put("flank", c.flank_length);
  }
  void put(const cutting::Nose& n) {
    put("radius", n.radius);
    for (const auto& wave : n.waves) {
      put("order", wave.order);
      put("amplitude", wave.amplitude);
      put("phase", wave.phase);
    }
  }
  void put(const ToolDescription& tool) {
    put("tool", tool.name);
    put("tool number", tool.number);
    std::visit([&](const auto& t) { put(t); }, tool.nominal);
    std::visit([&](const auto& t) { put(t); }, tool.actual);
    put("length", tool.length);
    put("actual length", tool.actual_length);
    put("offset", tool.centring_offset);
    put("height", tool.centring_height);
  }
  void put(const MeshFile& mesh) {
    put("file", mesh.file.string());
    put("unit", mesh.unit);
    put("any size", mesh.any_size);
    put("open", mesh.open);
  }
  void put(const cutting::Primitive& primitive) {
    put("surface", primitive.index());
    if (const auto* plane = std::get_if<cutting::RectanglePlane>(&primitive)) {
      put("x", plane->length_x);
      put("y", plane->length_y);
      return;
    }
    for (const auto& piece : cutting::profile(primitive).pieces) {
      put("from", piece.from);
      put("to", piece.to);
      put("arc", piece.arc_radius);
    }
  }
  void put(const PartDescription& part) {
    put("part", part.name);
    std::visit([&](const auto& shape) { put(shape); }, part.shape);
    put("T_wm", part.T_wm.matrix());
    put("vertices", part.vertices);
    put("judged max", part.judged_radius_max);
    put("judged min", part.judged_radius_min);
    put("judged normal", part.judged_normal_z);
    put("judged margin", part.judged_margin);
    put("tolerance", part.tolerance);
    for (const auto& ring : part.rings) {
      put("ring", ring.name);
      put("along", ring.along);
      put("width", ring.width);
    }
  }
  void put(const program::NcFormat& format) {
    put("decimals mm", format.decimals_mm);
    put("decimals deg", format.decimals_deg);
  }
  void put(const ProgramDescription::File& file) { put("program", file.file.string()); }
  void put(const program::Raster& r) {
    for (const double x :
         {r.step_over, r.step, r.lead, r.tilt, r.feed, r.speed_rpm, r.clearance, r.overrun}) {
      put("raster", x);
    }
    put("zigzag", r.zigzag);
    put(r.format);
  }
  void put(const program::Flank& f) {
    for (const double x : {f.step, f.feed, f.speed_rpm, f.clearance, f.tip_below}) put("flank", x);
    put(f.format);
  }
  void put(const program::Spiral& s) {
    for (const double x :
         {s.spindle_speed, s.feed_per_revolution, s.start_beyond_rim, s.end_radius, s.interval}) {
      put("spiral", x);
    }
    put("nc", s.write_nc);
    put(s.format);
  }
  void put(const ProgramDescription& program) {
    std::visit([&](const auto& source) { put(source); }, program.source);
    for (const auto& [h, length] : program.tool_length) put("H" + std::to_string(h), length);
    for (const auto& offset : program.work_offset) put("offset", offset);
  }
  void put(const DatumDescription& datum) {
    put("datum", int(datum.kind));
    put("point", datum.point_w);
    put("time", datum.time_s);
    for (const auto& touch : datum.touches) {
      put("touch", touch.point_w);
      put("along", touch.direction_w);
    }
  }

  // ---- instruments
  void put(const InstrumentDescription& description) {
    const errors::metrology::Instrument& i = description.instrument;
    put("instrument", i.name);
    put("kind", to_string(i.kind));
    for (const double x :
         {i.noise,          i.noise_rad,   i.resolution,  i.resolution_rad, i.rotation_sigma,
          i.position_sigma, i.scale_sigma, i.drift_sigma, i.margin,         i.radius,
          i.lever,          i.from_rad,    i.to_rad,      i.start_s,        i.interval_s,
          i.duration_s,     i.speed,       i.dwell_s,     i.set_up_s,       i.spindle_speed}) {
      put("instrument", x);
    }
    put("axes", std::string(i.axes.begin(), i.axes.end()));
    put("runs", i.runs);
    put("scatter", i.scatter);
    put("targets", i.targets);
    put("both ways", i.both_ways);
    put("has a place", i.at_w.has_value());
    if (i.at_w) put("at", *i.at_w);
    put("reflector", i.reflector_t);
    put("up", i.up_b);
    for (const double start : description.starts_s) put("start", start);
  }
  void put(const PartInstrumentDescription& description) {
    put("part instrument", description.name);
    put("of case", description.case_name);
    put("spacing", description.spacing);
    if (const auto* cmm = std::get_if<errors::metrology::CoordinateMachine>(&description.how)) {
      for (const double x : {cmm->noise, cmm->resolution, cmm->alignment_sigma,
                             cmm->alignment_sigma_rad, cmm->start_s, cmm->interval_s}) {
        put("cmm", x);
      }
      put("best fit", cmm->best_fit);
      return;
    }
    const auto& probe = std::get<errors::metrology::TouchProbe>(description.how);
    for (const double x : {probe.radius, probe.noise, probe.resolution, probe.clearance,
                           probe.speed, probe.dwell_s, probe.start_s}) {
      put("probe", x);
    }
    put("centre", probe.centre_t);
    put("pose", probe.q);
  }
  void put(const errors::identification::SensorChoiceOptions& choice) {
    put("count", choice.count);
    put("likeness", int(choice.likeness));
    put("grey", int(choice.grey.kind));
    put("image", int(choice.grey.image));
    put("rho", choice.grey.rho);
    put("theta", choice.grey.theta);
    put("threshold", choice.threshold);
    put("groups", choice.groups);
    put("screening", int(choice.screening));
  }
  void put(const SensorChoiceDescription& description) {
    const auto& study = description.study;
    put("sensors for", description.instrument);
    put(study.choice);
    for (const SensorChoiceDescription::Way& way : description.beside) {
      put("beside", way.name);
      put(way.choice);
      for (const std::string& name : way.choice.fixed) put("fixed", name);
      for (const std::string& name : way.drifts) put("for", name);
    }
    put("model", int(study.model.kind));
    put("since start", study.features.since_start);
    put("lag", study.features.lag_rows);
    put("subsets", study.random_subsets);
    put("study seed", study.seed);
  }

  // ---- heat
  void put(const errors::SpindleHeat& h) {
    put("power", h.power_W);
    put("reference", h.reference_speed);
    put("exponent", h.exponent);
  }
  void put(const errors::AxisHeat& h) {
    put("joint", h.joint);
    put("coulomb", h.coulomb);
    put("viscous", h.viscous);
  }
  void put(const errors::PowerOnHeat& h) { put("power", h.power_W); }
  void put(const errors::CuttingHeat& h) { put("share", h.share); }
  void put(const errors::ThermalNetwork& network) {
    for (const auto& node : network.nodes) put("node " + node.name, node.capacity_J_per_K);
    for (const auto& link : network.links) {
      put("from", link.a);
      put("to", link.b);
      put("conductance", link.conductance_W_per_K);
    }
    for (const auto& link : network.surroundings) {
      put("node", link.node);
      put("to", int(link.to));
      put("conductance", link.conductance_W_per_K);
    }
    for (const auto& source : network.sources) {
      put("heat in", source.node);
      put("law", source.law.index());
      std::visit([&](const auto& law) { put(law); }, source.law);
    }
    put("start", network.start_T_C);
  }
  void put(const std::string& name, const errors::ThermalFunction& function) {
    put(name, function.constant);
    for (const auto& term : function.terms) {
      put("node", term.node);
      put("minus", term.minus);
      put("per K", term.per_K);
      if (term.table) put(*term.table);
    }
  }
  void put(const std::string& name, const std::optional<errors::Expansion>& expansion) {
    put(name, expansion.has_value());
    if (!expansion) return;
    put("node", expansion->node);
    put("per K", expansion->per_K);
    put("fixed", expansion->fixed);
  }
  void put(const errors::ThermalErrors& thermal) {
    for (const auto& element : thermal.elements) {
      put("thermal element", errors::to_string(element.name));
      put("offset", element.offset);
      put("slope", element.slope);
      put("fixed", element.fixed);
    }
    for (const auto& axis : thermal.expansions) {
      put("expansion", axis.axis);
      put("feedback", int(axis.feedback));
      put("screw", axis.screw);
      put("scale", axis.scale);
    }
    if (thermal.workpiece) {
      put("workpiece at node", thermal.workpiece->node);
      put("per K", thermal.workpiece->per_K);
      put("fixed", thermal.workpiece->fixed_w);
    }
    put("reference", thermal.reference_T_C);
  }
  void put(const errors::TemperatureSensor& sensor) {
    put("sensor", sensor.name);
    put("node", sensor.node);
    for (const double x :
         {sensor.offset_K, sensor.noise_K, sensor.resolution_K, sensor.lag_s, sensor.sampling_s}) {
      put("sensor", x);
    }
    put("seed", sensor.seed);
  }
  void put(const ThermalDescription& thermal) {
    put(thermal.network);
    put(thermal.errors);
    for (const auto& sensor : thermal.sensors) put(sensor);
    for (const auto& phase : thermal.history) {
      put("phase", phase.duration);
      put("spindle", phase.spindle_speed);
      put("axes", phase.axis_speed);
      put("powered", phase.powered);
      put("coolant", phase.coolant);
    }
    put("room times", thermal.room_time_s);
    put("room", thermal.room_T_C);
    put("coolant at", thermal.coolant_T_C);
    put("powered", thermal.powered);
    put("coolant", thermal.coolant);
    put("interval", thermal.interval);
    put("scale", thermal.scale);
    for (const auto& plot : thermal.plots) {
      put("plot " + to_string(plot.element), plot.time_s);
      if (plot.range) put("from", plot.range->front());
      if (plot.range) put("to", plot.range->back());
    }
  }

  // ---- force
  void put(const errors::WorkpieceBar& bar) {
    put("clamp", bar.clamp_w);
    put("direction", bar.direction_w);
    put("length", bar.length);
    put("second moment", bar.second_moment);
    put("modulus", bar.youngs_modulus);
  }
  void put(const errors::WorkpiecePlate& plate) {
    put("foot", plate.foot_w);
    put("up", plate.up_w);
    put("normal", plate.normal_w);
    put("height", plate.height);
    put("thickness", plate.thickness);
    put("modulus", plate.youngs_modulus);
    put("poisson", plate.poisson_ratio);
  }
  void put(const errors::WorkpieceField& field) {
    put("points", field.points_w);
    for (const auto& C : field.compliance_w) put("C", C);
  }
  void put(const errors::ComplianceErrors& compliance) {
    for (const auto& joint : compliance.joints)
      put(std::string("compliance ") + joint.axis, joint.C);
    put("compliance tool", compliance.tool);
    put("compliance fixture", compliance.fixture);
    if (compliance.workpiece) {
      put("workpiece", compliance.workpiece->index());
      std::visit([&](const auto& part) { put(part); }, *compliance.workpiece);
    }
    put("scale", compliance.scale);
    for (const auto& mass : compliance.masses) {
      put(std::string("mass ") + mass.axis, mass.mass_kg);
      put("centre", mass.centre_b);
    }
    put("gravity", compliance.gravity_b);
    put("inertia", compliance.inertia);
    put("clamping", compliance.clamping_w);
  }
  void put(const errors::Vibration& vibration) {
    put("vibration", errors::to_string(vibration.name));
    for (const double x : {vibration.order, vibration.amplitude, vibration.reference_speed,
                           vibration.exponent, vibration.phase, vibration.damping}) {
      put("vibration", x);
    }
    put("resonance", vibration.resonance);
  }

  // ---- stock, and what the control reads
  void put(const cutting::BoxBlank& box) {
    put("lower", box.lower_k);
    put("upper", box.upper_k);
  }
  void put(const cutting::CylinderBlank& cylinder) {
    put("radius", cylinder.radius);
    put("lower", cylinder.lower);
    put("upper", cylinder.upper);
  }
  void put(const CuttingDescription::OffsetBlank& blank) {
    put("allowance", blank.allowance);
    put("floor", blank.floor);
  }
  void put(const CuttingDescription::TurnedBlank& blank) { put("profile", blank.profile); }
  void put(const cutting::CuttingCoefficients& material) {
    put("material", material.name);
    put("source", material.source);
    for (const double x : {material.K_tc, material.K_rc, material.K_ac, material.K_te,
                           material.K_re, material.K_ae}) {
      put("K", x);
    }
  }
  void put(const CuttingDescription& cutting) {
    put("blank", cutting.blank.index());
    std::visit([&](const auto& blank) { put(blank); }, cutting.blank);
    put("spacing", cutting.spacing);
    put("three", cutting.three_directions);
    put("bytes", cutting.max_bytes);
    if (cutting.material) put(*cutting.material);
    put("flutes", cutting.flutes.count);
    put("helix", cutting.flutes.helix);
    put("run-out", cutting.flutes.run_out);
    put("run-out angle", cutting.flutes.run_out_angle);
    put("clockwise", cutting.flutes.clockwise);
    put("step", cutting.step);
    put("to", cutting.tolerance);
    put("iterations", cutting.most_iterations);
  }
  void put(const SignalsDescription& signals) {
    for (const double x :
         {signals.interval, signals.history_interval, signals.encoder_resolution,
          signals.encoder_resolution_rad, signals.encoder_noise, signals.encoder_noise_rad}) {
      put("signals", x);
    }
    put("current", signals.current.has_value());
    if (const auto& current = signals.current) {
      for (const double x : {current->torque_per_current, current->idle_torque,
                             current->viscous_torque, current->noise_A, current->bandwidth}) {
        put("current", x);
      }
    }
    put("dynamometer", signals.dynamometer.has_value());
    if (const auto& dynamometer = signals.dynamometer) {
      for (const double x : {dynamometer->noise, dynamometer->resolution, dynamometer->bandwidth}) {
        put("dynamometer", x);
      }
    }
  }

  // ---- compensators
  void put(const BeliefDescription& belief) {
    put("believes geometry", belief.identified.has_value());
    if (belief.identified) put(*belief.identified);
    put("believes heat", belief.thermal.has_value());
    if (belief.thermal) put("heat", compensation::to_text(*belief.thermal));
    put("believes force", belief.force.has_value());
    if (const auto& force = belief.force) {
      put("from", int(force->from));
      put(force->compliance);
      put("training", force->training.string());
      put("read by", force->instrument);
      put("smoothing", force->smoothing_s);
      put("passes", force->passes);
    }
    put("believes the part", belief.part.has_value());
    if (belief.part) {
      put("read by", belief.part->instrument);
      put("passes", belief.part->passes);
    }
    put("belief scale", belief.scale);
  }
  void put(const compensation::PositionLoop& loop) {
    put("loop", int(loop.order));
    put("bandwidth", loop.bandwidth);
    put("damping", loop.damping);
  }
  void put(const CompensationDescription::Table& table) {
    put("points", table.options.most_points);
    put("spacing", table.options.spacing);
    put("spacing of turns", table.options.spacing_rad);
    put("cross", table.options.cross);
    put("both ways", table.options.both_ways);
    put("constant", table.options.constant);
    put("has a range", table.options.range.has_value());
    put("format", table.format ? compensation::to_string(*table.format) : "none");
    put("reference", table.reference);
  }
  void put(const CompensationDescription& c) {
    put("bound", c.rotary_bound);
    put("words", c.word_resolution);
    put("angle words", c.angle_resolution);
    put("path", c.path_tolerance);
    put(c.loop);
    for (const double x : {c.pulses.count, c.pulses.count_rad, c.pulses.cycle_s, c.pulses.pulse_s})
      put("pulses", x);
    for (const double x : {c.open.cycle_s, c.open.delay_s}) put("open", x);
    for (const double x : {c.origin.cycle_s, c.origin.delay_s, c.origin.increment, c.origin.rate})
      put("origin", x);
    put(c.table);
    put("piezo along", c.piezo.direction_t);
    for (const double x : {c.piezo.range, c.piezo.stiffness, c.piezo.resolution, c.piezo.cycle_s}) {
      put("piezo", x);
    }
    put(c.piezo.loop);
    put(c.plug_in);
  }
  void put(const CaseDescription& one) {
    put("case", one.name);
    put("belief", int(one.belief));
    put("strategy", int(one.strategy));
    put("channel", int(one.channel));
    put("plug-in", one.plug_in.string());
  }

  std::ostringstream out_;
};

inline std::string fingerprint(const Scene& scene) { return Fingerprint(scene).text(); }

}  // namespace abbe::sim
