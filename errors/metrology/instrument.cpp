#include "errors/metrology/instrument.h"

#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using namespace abbe::literals;

// In a workshop the noise of displacement optics comes from the air, not from the laser: some 0.05
// um over a metre of beam, averaged for a few seconds. 1 nm and 0.5 ppm with compensation of
// wavelength and material are specified for interferometers of the class of an XL-80.
void set_interferometer(Instrument& i) {
  i.noise = 0.05_um;
  i.resolution = 1.0_nm;
  i.scale_sigma = 0.25e-6;        // 0.5 ppm is stated at k = 2
  i.rotation_sigma = 200.0_urad;  // 0.2 mm of beam wander over 1 m
}

// Wollaston prism and angled mirror: 0.5 % of the reading and a resolution of 0.01 um are
// specified; the air contributes 0.3 um. The mirror is aligned to 0.5 mrad only, so slopes are
// meaningless.
void set_straightness_optics(Instrument& i) {
  i.noise = 0.3_um;
  i.resolution = 0.01_um;
  i.scale_sigma = 0.25e-2;
  i.rotation_sigma = 500.0_urad;
}

// 0.2 % of the reading, 0.1 urad + 0.1 urad/m and a resolution of 0.1 urad are specified.
void set_angular_optics(Instrument& i) {
  i.noise_rad = 0.2_urad;
  i.resolution_rad = 0.1_urad;
  i.scale_sigma = 0.1e-2;
}

// Wireless telescoping bars of the class of a QC20: resolution 0.1 um, sensor 0.5 um at k = 2,
// calibrated in length to about 2 um on 100 mm. The centre is found to 2 um. Sampling continues
// during the motion at 1 m/min.
void set_ball_bar(Instrument& i) {
  i.noise = 0.25_um;
  i.resolution = 0.1_um;
  i.scale_sigma = 2e-5;
  i.position_sigma = 2.0_um;
  i.dwell_s = 0.0;
  i.targets = 72;
  i.set_up_s = 600.0;
}

// Three eddy-current or optical sensors of 0.1 um. The nest is aligned to the axes with a dial
// indicator.
void set_sensor_nest(Instrument& i) {
  i.noise = 0.3_um;
  i.resolution = 0.1_um;
  i.rotation_sigma = 300.0_urad;
  i.position_sigma = 2.0_um;  // ball against the tip position assumed by the control
  i.targets = 36;
  i.dwell_s = 1.0;
}

void set_volume_grid(Instrument& i) {
  i.targets = 5;
  i.bidirectional = false;
  i.dwell_s = 3.0;
}

}  // namespace

Instrument typical_instrument(Kind kind) {
  Instrument i;
  i.kind = kind;
  i.name = to_string(kind);
  switch (kind) {
    case Kind::Laser:
      set_interferometer(i);
      i.runs = 5;  // ISO 230-2: five runs, at least five targets per metre, not equally spaced
      i.scatter = 0.3;
      break;
    case Kind::Straightness:
      set_straightness_optics(i);
      i.runs = 3;
      break;
    case Kind::AngleOptics:
      set_angular_optics(i);
      i.runs = 3;
      break;
    case Kind::Square:  // granite square of grade 00, read with a 0.1 um dial indicator
      i.noise = 0.3_um;
      i.resolution = 0.1_um;
      i.rotation_sigma = 500.0_urad;
      i.runs = 3;
      break;
    case Kind::Diagonals:  // ISO 230-6 follows ISO 230-2
      set_interferometer(i);
      i.runs = 5;
      i.set_up_s = 1800.0;
      break;
    case Kind::StepDiagonal:  // the flat mirror and the beam are aligned by the returning spot
      set_interferometer(i);
      i.targets = 10;
      i.runs = 3;
      i.bidirectional = false;
      i.set_up_s = 1800.0;
      break;
    case Kind::BallBar:
    case Kind::BallBarRotary:
      set_ball_bar(i);
      break;
    case Kind::RTest:
      set_sensor_nest(i);
      break;
    case Kind::Sphere:  // strain-gauge probe, 0.25 um at k = 2 per touch, five touches per sphere
      i.noise = 0.5_um;
      i.resolution = 0.1_um;
      i.rotation_sigma = 0.0;  // the slides themselves measure, so no sensor is misaligned
      i.position_sigma = 2.0_um;
      i.targets = 7;
      i.bidirectional = false;
      i.dwell_s = 40.0;
      break;
    case Kind::Tracker:  // interferometer 0.5 um/m, encoders 1.5 urad after averaging
      set_volume_grid(i);
      i.noise = 0.5_um;
      i.noise_rad = 1.5_urad;
      i.resolution = 0.1_um;
      i.resolution_rad = 0.1_urad;
      i.scale_sigma = 0.5e-6;
      // Position and orientation of the station are identified from the readings.
      i.rotation_sigma = 1000.0_urad;
      i.position_sigma = 1.0;
      break;
    case Kind::Multilateration:  // tracking interferometer: 0.2 um + 0.3 ppm at k = 2
      set_volume_grid(i);
      i.noise = 0.1_um;
      i.resolution = 1.0_nm;
      i.scale_sigma = 0.15e-6;
      i.position_sigma = 1.0;
      break;
    case Kind::Level:  // electronic, 1 urad of resolution, 2 um/m in a quiet hall
      i.noise_rad = 2.0_urad;
      i.resolution_rad = 1.0_urad;
      i.rotation_sigma = 5e-3;  // aligned with the axes by eye
      i.dwell_s = 10.0;         // settling time of the pendulum
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
