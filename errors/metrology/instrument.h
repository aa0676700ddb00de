#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/readings.h"

namespace abbe::errors::metrology {

/// What there is in the instrument cupboard.
enum class Kind {
  Laser,          ///< interferometer, positioning of each axis, bidirectional (ISO 230-2)
  Straightness,   ///< straightness optics, both ways across each slide
  AngleOptics,    ///< pitch and yaw of each slide; of a rotary axis its position (polygon)
  Square,         ///< two straightness lines against one artefact square, each pair of slides
  Diagonals,      ///< four body and six face diagonals with a retroreflector (ISO 230-6)
  StepDiagonal,   ///< four body diagonals in steps of X, Y, Z against a flat mirror (laser vector)
  BallBar,        ///< circles and partial arcs in each plane (ISO 230-4)
  BallBarRotary,  ///< the bar held radially, tangentially, axially while a rotary axis turns and
                  ///< the slides follow (ISO 10791-6)
  RTest,          ///< ball at the tool, three sensors on the table, rotary axes turn (ISO 10791-6)
  Sphere,         ///< touch probing of a sphere on the table in many rotary positions
  Tracker,        ///< laser tracker: range and two angles to a reflector on a grid of the volume
  Multilateration,  ///< lengths alone, from four places of a tracking interferometer
  Level,            ///< tilt against gravity of the carriage, each slide
  RollLines,        ///< straightness along two parallel lines a lever apart: roll without a level
  Spindle,          ///< spindle analyser: five sensors around a master artefact (ISO 230-7)
  Drift,            ///< three displacements and two tilts at one place over time (ISO 230-3)
  Temperature,      ///< the log of the machine's sensors alone
};
/// Word of a kind in scenes and files, "step_diagonal"; and back. Empty if there is no such kind.
std::string to_string(Kind kind);
std::optional<Kind> kind_of(std::string_view word);
/// Every kind, in the order above.
std::span<const Kind> all_kinds();

/// An instrument and how it is used. Fields that a kind does not need change nothing.
struct Instrument {
  std::string name;
  Kind kind = Kind::Laser;
  double noise = 0.0;           ///< mm, of lengths and displacements
  double noise_rad = 0.0;       ///< rad, of angles (of a tracker: of its encoders)
  double resolution = 0.0;      ///< mm
  double resolution_rad = 0.0;  ///< rad
  double rotation_sigma = 0.0;  ///< rad, alignment of a beam, an artefact, a nest of sensors
  double position_sigma = 0.0;  ///< mm, places of reflectors, balls and stations
  double scale_sigma = 0.0;     ///< relative: wavelength and material temperature, bar length
  double drift_sigma = 0.0;     ///< mm/s
  std::vector<char> axes;       ///< which; empty: all that make sense (of planes and diagonals:
                                ///< those between them)
  int runs = 1;
  int targets = 11;       ///< along an axis, around a circle, per diagonal, per grid line;
                          ///< steps of a step diagonal, readings a turn of a spindle
  double scatter = 0.0;   ///< of the spacing: how far targets between the first and the last stand
                          ///< off equal spacing, so that no pitch hides between them (ISO 230-2)
  bool both_ways = true;  ///< bidirectional; circles also clockwise
  double margin = 0.02;   ///< of the travel left free at both ends
  std::optional<Eigen::Vector3d> at_w;  ///< mm: where balls at the tool, nests, circles'
                                        ///< centres and a tracker are in the workpiece; else
                                        ///< a default in the travel
  Eigen::Vector3d reflector_t = Eigen::Vector3d::Zero();  ///< mm, from the tip to the reflector
  double radius = 100.0;  ///< mm: circles, the bar, the place of a ball from a rotary axis
  double lever = 200.0;   ///< mm: between parallel lines, sensor heights of a spindle test
  double from_rad = 0.0, to_rad = 6.283185307179586;  ///< arc of circles and rotary axes; of
                                                      ///< these cut to the travel, a whole turn
                                                      ///< to all the travel there is
  double start_s = 0.0;          ///< time of the first reading (negative: in the thermal history)
  double interval_s = 60.0;      ///< drift and temperature: between readings
  double duration_s = 3600.0;    ///< drift and temperature
  double speed = 1000.0 / 60.0;  ///< mm/s between targets
  double dwell_s = 4.0;          ///< at each target
  double set_up_s = 1200.0;      ///< a person's time for each set-up
  double spindle_speed = 0.0;    ///< rad/s, of a spindle test, and while drift is read
  Eigen::Vector3d up_b = Eigen::Vector3d::UnitZ();  ///< unit, against gravity: a level's plumb line
};

/// An instrument of a kind as it is usually bought and used; every number with its source or reason
/// beside it in the .cpp. `name` is the word of the kind.
Instrument typical(Kind kind);

/// The plan of an instrument on a machine: targets within the travel, approached as the standards
/// ask, in the order in which a person would do them, with times.
/// Slides wait in the middle of their travel, rotary axes at 0 (or in the middle), spindles at 0.
/// Readings of a step diagonal count legs: 0 at the start of a run, 3 k + 1 after leg X of step k,
/// 3 k + 2 after Y, 3 k + 3 after Z; each of the four diagonals is a set-up and rises in Z.
/// @throws std::invalid_argument in a sentence: an axis that the machine lacks or that the kind
///         cannot measure, targets that leave the travel, a radius that does not fit, a number out
///         of range; fewer than the slides needed
Plan plan(const Instrument& instrument, const kinematics::Chain& nominal);

}  // namespace abbe::errors::metrology
