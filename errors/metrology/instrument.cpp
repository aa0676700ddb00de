#include "errors/metrology/instrument.h"

#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using namespace abbe::literals;

// The noise of displacement optics in a workshop is the air, not the laser: some 0.05 um over a
// metre of beam averaged for a few seconds. 1 nm and 0.5 ppm with compensation of wavelength and
// material are the specification of interferometers of the class of an XL-80.
void interferometer(Instrument& i) {
  i.noise = 0.05_um;
  i.resolution = 1.0_nm;
  i.scale_sigma = 0.25e-6;        // 0.5 ppm is stated at k = 2
  i.rotation_sigma = 200.0_urad;  // 0.2 mm of beam wander over 1 m
}

// Wollaston prism and angled mirror: specified 0.5 % of the reading and 0.01 um of resolution; the
// air contributes 0.3 um. The mirror is aligned to 0.5 mrad, which is why slopes are meaningless.
void straightness_optics(Instrument& i) {
  i.noise = 0.3_um;
  i.resolution = 0.01_um;
  i.scale_sigma = 0.25e-2;
  i.rotation_sigma = 500.0_urad;
}

// Specified: 0.2 % of the reading and 0.1 urad + 0.1 urad/m; resolution 0.1 urad.
void angular_optics(Instrument& i) {
  i.noise_rad = 0.2_urad;
  i.resolution_rad = 0.1_urad;
  i.scale_sigma = 0.1e-2;
}

// Wireless telescoping bars of the class of a QC20: resolution 0.1 um, sensor 0.5 um at k = 2,
// calibrated in length to about 2 um on 100 mm; the centre is found to 2 um, and sampling continues
// during the motion at 1 m/min.
void bar(Instrument& i) {
  i.noise = 0.25_um;
  i.resolution = 0.1_um;
  i.scale_sigma = 2e-5;
  i.position_sigma = 2.0_um;
  i.dwell_s = 0.0;
  i.targets = 72;
  i.set_up_s = 600.0;
}

// Three eddy-current or optical sensors of 0.1 um; the nest is aligned to the axes by a dial
// indicator.
void nest(Instrument& i) {
  i.noise = 0.3_um;
  i.resolution = 0.1_um;
  i.rotation_sigma = 300.0_urad;
  i.position_sigma = 2.0_um;  // ball against the tip position assumed by the control
  i.targets = 36;
  i.dwell_s = 1.0;
}

void volume(Instrument& i) {
  i.targets = 5;
  i.both_ways = false;
  i.dwell_s = 3.0;
}

}  // namespace

Instrument typical(Kind kind) {
  Instrument i;
  i.kind = kind;
  i.name = to_string(kind);
  switch (kind) {
    case Kind::Laser:
      interferometer(i);
      i.runs = 5;  // ISO 230-2: five runs, at least five targets per metre, not equally spaced
      i.scatter = 0.3;
      break;
    case Kind::Straightness:
      straightness_optics(i);
      i.runs = 3;
      break;
    case Kind::AngleOptics:
      angular_optics(i);
      i.runs = 3;
      break;
    case Kind::Square:  // granite square of grade 00, read with a 0.1 um dial indicator
      i.noise = 0.3_um;
      i.resolution = 0.1_um;
      i.rotation_sigma = 500.0_urad;
      i.runs = 3;
      break;
    case Kind::Diagonals:  // ISO 230-6 follows ISO 230-2
      interferometer(i);
      i.runs = 5;
      i.set_up_s = 1800.0;
      break;
    case Kind::StepDiagonal:  // the flat mirror and the beam are aligned by the returning spot
      interferometer(i);
      i.targets = 10;
      i.runs = 3;
      i.both_ways = false;
      i.set_up_s = 1800.0;
      break;
    case Kind::BallBar:
      bar(i);
      break;
    case Kind::BallBarRotary:
      bar(i);
      break;
    case Kind::RTest:
      nest(i);
      break;
    case Kind::Sphere:  // strain-gauge probe, 0.25 um at k = 2 per touch, five touches per sphere
      i.noise = 0.5_um;
      i.resolution = 0.1_um;
      i.rotation_sigma = 0.0;  // it reads along the directions of the axes themselves
      i.position_sigma = 2.0_um;
      i.targets = 7;
      i.both_ways = false;
      i.dwell_s = 40.0;
      break;
    case Kind::Tracker:  // interferometer 0.5 um/m, encoders 1.5 urad after averaging
      volume(i);
      i.noise = 0.5_um;
      i.noise_rad = 1.5_urad;
      i.resolution = 0.1_um;
      i.resolution_rad = 0.1_urad;
      i.scale_sigma = 0.5e-6;
      i.rotation_sigma =
          1000.0_urad;  // position and orientation of the station are identified from the readings
      i.position_sigma = 1.0;
      break;
    case Kind::Multilateration:  // tracking interferometer: 0.2 um + 0.3 ppm at k = 2
      volume(i);
      i.noise = 0.1_um;
      i.resolution = 1.0_nm;
      i.scale_sigma = 0.15e-6;
      i.position_sigma = 1.0;
      break;
    case Kind::Level:  // electronic, 1 urad of resolution, 2 um/m in a quiet hall
      i.noise_rad = 2.0_urad;
      i.resolution_rad = 1.0_urad;
      i.rotation_sigma = 5e-3;  // aligned with the axes by eye
      i.dwell_s = 10.0;         // its pendulum settles
      i.runs = 3;
      break;
    case Kind::RollLines:  // two 0.1 um gauges on a flat straightedge
      i.noise = 0.2_um;
      i.resolution = 0.1_um;
      i.rotation_sigma = 500.0_urad;
      i.runs = 3;
      break;
    case Kind::Spindle:  // capacitive sensors, 15 nm; the ball is centred by tapping to 10 um
      i.noise = 15.0_nm;
      i.resolution = 1.0_nm;
      i.position_sigma = 10.0_um;
      i.lever = 50.0;
      i.runs = 20;
      i.targets = 64;
      i.spindle_speed = 1000.0 * units::rpm;
      i.set_up_s = 2400.0;
      break;
    case Kind::Drift:  // sensors of a spindle analyser in a nest of low expansion; one hour
      i.noise = 0.02_um;
      i.noise_rad = 0.5_urad;  // 0.02 um over 50 mm between two sensors, plus bending of the nest
      i.resolution = 0.01_um;
      i.resolution_rad = 0.1_urad;
      i.rotation_sigma = 1000.0_urad;
      break;
    case Kind::Temperature:
      break;
  }
  return i;
}

}  // namespace abbe::errors::metrology
