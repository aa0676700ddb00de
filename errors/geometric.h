#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "errors/coefficients.h"
#include "errors/curve.h"
#include "errors/element.h"
#include "kinematics/chain.h"

namespace abbe::errors {

/// Who carried the point at which translations were measured.
enum class MeasuredBy {
  Tool,  ///< the point is where the tool was: on a tool-side slide it travels with the carriage,
         ///< on a primed slide it stands still in the bed
  Carriage,  ///< the point travels with the carriage
};

/// The translations of a slide were measured on this line, not at its joint's point.
struct MeasuringLine {
  char axis = 'X';
  Eigen::Vector3d at_b = Eigen::Vector3d::Zero();  ///< mm, bed frame, all axes at zero
  MeasuredBy by = MeasuredBy::Carriage;
};

/// A description of geometric errors: what an errors file says.
struct GeometricErrors {
  std::vector<Element> elements;
  std::vector<MeasuringLine> measuring_lines;
  Covariance covariance = {};  ///< of a belief: how well its numbers are known
};

/// The same bound to a chain: per joint, which elements move it. Immutable: made by `bind`, changed
/// only by making another.
struct GeometricModel {
  struct Bound {
    int joint = 0;      ///< index in the chain
    int component = 0;  ///< 0..5
    bool location = false;
    Element element;
  };
  std::vector<Bound> elements;
  struct Line {
    int joint = 0;
    Eigen::Vector3d arm_b;  ///< measured point minus joint point at zero
    Eigen::Vector3d direction_b = Eigen::Vector3d::Zero();  ///< of the joint, unit
    bool is_fixed_in_bed = false;  ///< the joint's point leaves the measured point as it travels
  };
  std::vector<Line> lines;
  std::vector<char> is_joint_primed;  ///< (chain size) 1 where the carriage travels by -command

  // Prepared from the above, so that `deviations` adds up only what changes.
  struct Term {
    int joint = 0;
    int component = 0;    ///< 0..5 of its motion
    int element = 0;      ///< index in elements
    int curve = 0;        ///< index in its curves
    int group = -1;       ///< of a series, index in groups
    int place = 0;        ///< in the group
    double factor = 1.0;  ///< of the series
  };
  struct Group {
    int joint = 0;
    SeriesGroup series;
  };
  static constexpr std::size_t max_groups = 24;
  std::vector<kinematics::JointDeviation> constant;  ///< (chain size) sum of all constant curves
  std::vector<Term> terms;                           ///< every other curve
  std::vector<Group> groups;  ///< at most most_groups: series that share their functions
};

/// Axis 'S' is the joint S (a spindle that carries the workpiece) if the chain has one,
/// else the nose s.
/// @throws std::invalid_argument naming the element: an axis that the chain lacks, a location
///         element that is not constant, a location direction that means nothing for that axis (a
///         squareness of an axis about itself, an offset of a slide or along a rotary axis; a
///         constant error motion says that), a spindle's turn about itself, a curve that `validate`
///         refuses, a measuring line on an axis that is not a slide, an element or a line twice
GeometricModel bind(const GeometricErrors& errors, const kinematics::Chain& chain);

/// Deviation of every joint at a state, in the order of the chain. Translations measured on a line
/// are carried to the joint's point with that joint's own angles: d(P) = d(M) - theta x (M - P).
/// @throws std::out_of_range where a table is left, naming the element
std::vector<kinematics::JointDeviation> deviations(const GeometricModel& model,
                                                   const kinematics::AxisState& state);

/// The model without its random parts: what the best possible identification could know.
GeometricModel without_random(const GeometricModel& model);

/// Every value of the model times `factor`.
GeometricModel scaled(const GeometricModel& model, double factor);

/// What the curves of a joint see at a state.
CurveState curve_state(const GeometricModel& model, const kinematics::AxisState& state, int joint);

/// Source of elements, for the wording of a warning.
struct ElementSource {
  std::string section = "errors";  ///< of the scene, before the name of an element
  bool identified = false;         ///< found from readings, not stated
};

/// Returns a warning for each element whose size no machine has, as of a number in another unit
/// than its key: 0.25 mm or 2.5 mrad and more; of a slide or a location, 10 nm or 0.01 urad and
/// less but not nothing (only where it is stated). Each with its largest value at 129 positions of
/// its axis from `least` to `most`, of a spindle over a turn. Of stated curves also those that are
/// followed beyond their range, and tables held far beyond theirs.
/// @param model  with the scale of the errors in it
std::vector<std::string> element_warnings(const GeometricModel& model,
                                          const kinematics::AxisVector& least,
                                          const kinematics::AxisVector& most,
                                          const ElementSource& source = {});

}  // namespace abbe::errors
