#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/readings.h"

namespace abbe::errors::metrology {

/// Kinds of instruments.
enum class Kind {
  Laser,          ///< interferometer, positioning of each axis, bidirectional (ISO 230-2)
  Straightness,   ///< straightness optics, both directions across each slide
  AngleOptics,    ///< pitch and yaw of each slide; positioning of a rotary axis (polygon)
  Square,         ///< two straightness lines against one square artefact, each pair of slides
  Diagonals,      ///< four body and six face diagonals with a retroreflector (ISO 230-6)
  StepDiagonal,   ///< four body diagonals in steps of X, Y, Z against a flat mirror (laser vector)
  BallBar,        ///< circles and partial arcs in each plane (ISO 230-4)
  BallBarRotary,  ///< bar held radially, tangentially or axially while a rotary axis turns and the
                  ///< slides follow (ISO 10791-6)
  RTest,          ///< ball at the tool, three sensors on the table, rotary axes turn (ISO 10791-6)
  Sphere,         ///< sphere on the table, probed by touch in many rotary positions
  Tracker,        ///< laser tracker: range and two angles to a reflector on a grid of the volume
  Multilateration,  ///< lengths alone, from four stations of a tracking interferometer
  Level,            ///< tilt of the carriage against gravity, each slide
  RollLines,        ///< straightness along two parallel lines a lever apart: roll without a level
  Spindle,          ///< spindle analyser: five sensors around a master artefact (ISO 230-7)
  Drift,            ///< three displacements and two tilts at one position over time (ISO 230-3)
  Temperature,      ///< log of the machine's temperature sensors alone
};
/// Return the name of a kind in scenes and files, e.g. "step_diagonal", and the kind of that name,
/// or nothing if there is none.
std::string to_string(Kind kind);
std::optional<Kind> find_kind(std::string_view name);
/// Returns all kinds, in the order above.
std::span<const Kind> all_kinds();

/// An instrument and its use. Members that a kind does not need have no effect.
struct Instrument {
  std::string name;
  Kind kind = Kind::Laser;
  double noise = 0.0;           ///< mm, standard deviation of lengths and displacements
  double noise_rad = 0.0;       ///< rad, standard deviation of angles (of a tracker: those of
                                ///< its encoders)
  double resolution = 0.0;      ///< mm
  double resolution_rad = 0.0;  ///< rad
  double rotation_sigma = 0.0;  ///< rad, alignment of a beam, an artefact or a nest of sensors
  double position_sigma = 0.0;  ///< mm, positions of reflectors, balls and stations
  double scale_sigma = 0.0;     ///< relative standard deviation of the scale: of a laser from
                                ///< wavelength and material temperature, of a bar from its
                                ///< calibrated length
  double drift_sigma = 0.0;     ///< mm/s (rad/s for angles), standard deviation of the drift rate,
                                ///< which is constant during a set-up
  std::vector<char> axes;       ///< axes to be measured; empty: all suitable ones (planes and
                                ///< diagonals: those between these axes)
  int runs = 1;
  int targets = 11;      ///< number along an axis, around a circle, per diagonal or per grid line;
                         ///< steps of a step diagonal, readings per turn of a spindle
  double scatter = 0.0;  ///< relative to the spacing: deviation of inner targets from equal
                         ///< spacing, so that they reveal periodic errors of any pitch (ISO 230-2)
  bool bidirectional = true;  ///< targets are approached from both directions; circles are run
                              ///< counter-clockwise and clockwise
  double margin = 0.02;       ///< fraction of the travel left free at both ends
  std::optional<Eigen::Vector3d> location_w;  ///< mm: position of balls at the tool, nests, circle
                                              ///< centres and a tracker in the workpiece; by
                                              ///< default within the travel
  Eigen::Vector3d reflector_t = Eigen::Vector3d::Zero();  ///< mm, from the tip to the reflector
  double radius = 100.0;  ///< mm: of circles, length of the bar, distance of a ball from a rotary
                          ///< axis
  double lever = 200.0;   ///< mm: between parallel lines, between sensor heights of a spindle test
  /// Arc of circles and of rotary axes. For a rotary axis it is clipped to the travel; an arc of a
  /// whole turn or more that exceeds the travel is replaced by the full travel.
  double from_rad = 0.0, to_rad = 6.283185307179586;
  double start_s = 0.0;          ///< time of the first reading; negative: within the thermal
                                 ///< history
  double interval_s = 60.0;      ///< between readings of drift and temperature
  double duration_s = 3600.0;    ///< of drift and temperature
  double speed = 1000.0 / 60.0;  ///< mm/s between targets
  double dwell_s = 4.0;          ///< wait at each target
  double set_up_s = 1200.0;      ///< time that an operator needs for each set-up
  double spindle_speed = 0.0;    ///< rad/s, of a spindle test, and during a drift test
  Eigen::Vector3d up_b = Eigen::Vector3d::UnitZ();  ///< unit, upwards; a level refers to it
};

/// Returns an instrument of this kind with typical specifications and settings. Its name is that of
/// the kind. The source of, or reason for, every number is in instrument.cpp.
Instrument typical_instrument(Kind kind);

/// Returns the measuring plan of an instrument on a machine: targets within the travel, approached
/// as the standards require, in the order in which an operator takes them, with times. Slides that
/// do not move are in the middle of their travel, rotary axes at 0 (or in the middle), spindles at
/// 0. Readings of a step diagonal count legs: 0 at the start of a run, 3 k + 1 after leg X of step
/// k, 3 k + 2 after Y, 3 k + 3 after Z; each of the four diagonals is a set-up and rises in Z.
/// @throws std::invalid_argument for an axis that the machine lacks or that the kind cannot
///         measure, targets beyond the travel, a radius that does not fit, a number out of range,
///         or fewer slides than needed
Plan plan(const Instrument& instrument, const kinematics::Chain& nominal);

}  // namespace abbe::errors::metrology
