#pragma once

#include <ostream>
#include <sstream>
#include <string>

#include "sim/scene.h"

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
    for (const auto& element : scene.geometric.elements) put(element);
    for (const auto& line : scene.geometric.measuring_lines) {
      put(std::string("line ") + line.axis, line.at_b);
      put("by", int(line.by));
    }
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
    put("bound", scene.compensation.rotary_bound);
    put("words", scene.compensation.word_resolution);
    put("angle words", scene.compensation.angle_resolution);
    for (const auto& one : scene.cases) {
      put("case", one.name);
      put("strategy", int(one.strategy));
      put("channel", int(one.channel));
    }
    for (const auto& variant : scene.variants) {
      put("variant", variant.name);
      for (const auto& [path, value] : variant.set) put(path, value);
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
  }
  void put(const program::NcFormat& format) {
    put("decimals mm", format.decimals_mm);
    put("decimals deg", format.decimals_deg);
  }
  void put(const ProgramDescription::File& file) { put("program", file.file.string()); }
  void put(const program::Raster& r) {
    for (const double x : {r.step_over, r.step, r.lead, r.tilt, r.feed, r.clearance, r.overrun}) {
      put("raster", x);
    }
    put("zigzag", r.zigzag);
    put(r.format);
  }
  void put(const program::Flank& f) {
    for (const double x : {f.step, f.feed, f.clearance, f.tip_below}) put("flank", x);
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

  std::ostringstream out_;
};

inline std::string fingerprint(const Scene& scene) { return Fingerprint(scene).text(); }

}  // namespace abbe::sim
