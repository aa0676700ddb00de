// From files of readings to a belief, on whole scenes: what is found is what was put in.

#include "errors/coefficients.h"
#include "kinematics/decompositions.h"
#include "sim/commands/calibration_commands.h"
#include "sim/machine/truth.h"
#include "sim/report/identification_report.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/measured_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using Files = std::vector<fs::path>;
using Json = nlohmann::ordered_json;

/// Measures with every instrument given and writes the files into a folder.
Files campaign(const Scene& scene, const std::vector<InstrumentDescription>& instruments,
               const SceneFolder& folder) {
  Files files;
  for (const InstrumentDescription& one : instruments)
    files.push_back(
        folder.write(one.instrument.name + ".csv", to_text(measure_machine(scene, one))));
  return files;
}

errors::GeometricErrors belief_in(const fs::path& file, const std::string& scene) {
  return read_scene(packaged(scene), {{"errors", "\"" + file.string() + "\""}}).geometric;
}

/// Error of a pose: of the tip in mm and of the tool's axis in rad, both in the workpiece.
Eigen::Matrix<double, 6, 1> error_at(const kinematics::Chain& nominal,
                                     const errors::GeometricModel& errors, const AxisState& state) {
  const kinematics::Pose actual =
      nominal.tool_in_workpiece(state.q, errors::deviations(errors, state));
  const kinematics::Pose should_be = nominal.tool_in_workpiece(state.q);
  Eigen::Matrix<double, 6, 1> error;
  error << actual.translation() - should_be.translation(),
      actual.linear().col(2) - should_be.linear().col(2);
  return error;
}

// ---------------------------------------------------------------- truth in, truth out

const std::vector<std::string> slide_motions = {"EXX", "EYX", "EZX", "EAX", "EBX",  "ECX",  "EXY",
                                                "EYY", "EZY", "EAY", "EBY", "ECY",  "EXZ",  "EYZ",
                                                "EZZ", "EAZ", "EBZ", "ECZ", "EC0Y", "EB0Z", "EA0Z"};

/// Legendre series of order 3 for every error motion of the gantry's slides, drawn, but for
/// constants and slopes of straightness, and the three squarenesses.
std::string drawn_truth(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  const double half[] = {300, 350, 200}, centre[] = {0, 0, 150};
  std::string text = fmt::format("[errors]\nEC0Y_urad = {}\nEB0Z_urad = {}\nEA0Z_urad = {}\n",
                                 40 * any(random), 40 * any(random), 40 * any(random));
  for (const std::string& name : slide_motions) {
    if (name.size() > 3) continue;
    const int axis = name[2] - 'X';
    const bool angle = name[1] <= 'C', straightness = !angle && name[1] != name[2];
    text += fmt::format(
        "[errors.{}]\nkind = \"legendre\"\ncentre_mm = {}\nhalf_range_mm = {}\n"
        "coefficients_{} = [0, {}, {}, {}]\n",
        name, centre[axis], half[axis], angle ? "urad" : "um",
        straightness ? 0.0 : 10 * any(random), 10 * any(random), 5 * any(random));
  }
  return text;
}

TEST(Identify, NoiseFreeReadingsReturnTheTruthThroughFiles) {
  SeededRandom random(20261123);
  const SceneFolder folder;
  const Scene scene = scene_of(measured_scene(drawn_truth(random)));
  std::vector<InstrumentDescription> instruments;
  for (const char* name : {"laser", "straightness", "angle_optics", "roll_lines", "square"}) {
    instruments.push_back(faultless(scene, name));
    instruments.back().instrument.axes = {'X', 'Y', 'Z'};
  }
  IdentificationOptions options;
  options.model.order = 3;
  options.model.only = slide_motions;
  options.out = folder.path() / "belief.toml";
  const Json report = to_json(identify(campaign(scene, instruments, folder), options));
  EXPECT_TRUE(report["warnings"].empty()) << report["warnings"];
  EXPECT_TRUE(report["confounded"].empty()) << report["confounded"];
  const auto nominal = make_machine(scene).nominal;
  const auto truth = errors::bind(scene.geometric, nominal);
  const auto belief = errors::bind(belief_in(options.out, "gantry_perfect.toml"), nominal);
  double length = 0.0, angle = 0.0;  // worst of any element at any place
  for (int i = 0; i <= 20; ++i) {
    AxisState state;
    state.q = kinematics::AxisVector::Zero(6);
    state.q.segment<3>(1) << -300 + 30 * i, -350 + 35 * i, -50 + 20 * i;
    state.direction.fill(1);
    const auto is = errors::deviations(truth, state), believed = errors::deviations(belief, state);
    for (std::size_t j = 0; j < is.size(); ++j) {
      const kinematics::Deviation motion = is[j].motion - believed[j].motion;
      const kinematics::Deviation place = is[j].location - believed[j].location;
      for (const kinematics::Deviation& apart : {motion, place}) {
        length = std::max(length, apart.head<3>().cwiseAbs().maxCoeff());
        angle = std::max(angle, apart.tail<3>().cwiseAbs().maxCoeff());
      }
    }
  }
  std::cout << report["found"] << " numbers found; curves within " << length << " mm and " << angle
            << " rad of the truth\n";
  // coefficients to 1e-9 of the largest of their kind (10 um, 10 urad); a curve sums up to four
  EXPECT_LT(length, 4e-9 * 10.0_um);
  EXPECT_LT(angle, 4e-9 * 10.0_urad);
}

// ---------------------------------------------------------------- what is not identified, and
// refusals

std::string refusal_of_identifying(const Files& files, const SceneFolder& folder) {
  IdentificationOptions options;
  options.out = folder.path() / "refused.toml";
  std::string refusal;
  try {
    identify(files, options);
  } catch (const BadInput& fault) {
    refusal = fault.what();
  } catch (const BadScene& fault) {
    refusal = fault.what();
  }
  EXPECT_FALSE(fs::exists(options.out)) << "a refusal leaves no belief";
  return refusal;
}

TEST(Identify, TheLaserAloneNamesWhatItCannotTell) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  IdentificationOptions options;
  options.out = folder.path() / "belief.toml";
  const IdentificationResult found =
      identify(campaign(scene, {find_instrument(scene, "laser")}, folder), options);
  const Json report = to_json(found);
  std::vector<std::string> unhidden;
  bool pitch_hides = false;
  for (const Json& one : report["confounded"]) {
    const std::string name = one["name"];
    if (one["hidden_by"].empty()) unhidden.push_back(name);
    pitch_hides = pitch_hides || (name.starts_with("EBX") && !one["hidden_by"].empty());
  }
  for (const std::string roll : {"EAX", "EBY", "ECZ", "EYX", "EC0Y"})
    EXPECT_TRUE(std::any_of(unhidden.begin(), unhidden.end(),
                            [&](const std::string& name) { return name.starts_with(roll); }))
        << roll << " is seen by no reading of a laser";
  EXPECT_TRUE(pitch_hides) << "pitch of X hides in its positioning over the arm";
  const std::string text = identification_text(found);
  EXPECT_HAS(text, "unobservable, omitted");
  for (const auto& element : belief_in(options.out, "gantry_dome.toml").elements)
    if (to_string(element.name) == "EAX") {
      EXPECT_TRUE(errors::values({element}).isZero(0.0))
          << "what is not identified is not believed";
    }
}

TEST(Identify, ReadingsOfDifferentMachinesAreRefusedByName) {
  const SceneFolder folder;
  const Scene gantry = read_scene(packaged("gantry_dome.toml"));
  const Scene three = scene_of(measured_scene("", "three_axis_table"));
  InstrumentDescription other = find_instrument(three, "laser");
  other.instrument.name = "other";
  Files files = campaign(gantry, {find_instrument(gantry, "laser")}, folder);
  files.push_back(campaign(three, {other}, folder).front());
  const std::string refusal = refusal_of_identifying(files, folder);
  for (const char* word : {"laser.csv", "other.csv", "machine"}) EXPECT_HAS(refusal, word);
}

TEST(Identify, WhatHoldsNoReadingsOfAMachineIsRefusedByName) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  const Files good = campaign(scene, {find_instrument(scene, "laser")}, folder);
  const auto with = [&](const fs::path& bad) {
    return refusal_of_identifying({good.front(), bad}, folder);
  };
  EXPECT_HAS(with(folder.path() / "absent.csv"), "absent.csv");
  EXPECT_HAS(with(folder.write("empty.csv", "")), "empty.csv");
  EXPECT_HAS(with(folder.write("other.csv", "target_mm,direction\n")), "other.csv:1");
  EXPECT_HAS(with(folder.path()), folder.path().string());
  const Scene warm = read_scene(packaged("thermal_protocol.toml"));
  const Files log = campaign(warm, {find_instrument(warm, "temperature")}, folder);
  EXPECT_HAS(with(log.front()), "only a temperature log");
}

// ---------------------------------------------------------------- Peng's platform

/// Poses of the tip as the packaged parts of the platform ask for them.
std::vector<AxisState> poses_of_part(const std::string& scene) {
  const Job job = job_of(scene);
  std::vector<AxisState> poses;
  const std::size_t every = std::max<std::size_t>(1, job.samples.states.size() / 2000);
  for (std::size_t i = 0; i < job.samples.states.size(); i += every)
    poses.push_back(job.samples.states[i]);
  return poses;
}

/// The x component of the tip's error over the poses of one part, as it is after touching off on
/// the face: without its mean.
VectorXd axial_error(const errors::GeometricErrors& errors, const std::vector<AxisState>& poses) {
  const auto nominal = make_machine(read_scene(packaged("platform_calibration.toml"))).nominal;
  const auto model = errors::bind(errors, nominal);
  VectorXd e_x(Index(poses.size()));
  for (std::size_t i = 0; i < poses.size(); ++i)
    e_x[Index(i)] = error_at(nominal, model, poses[i])[0];
  return e_x.array() - e_x.mean();
}

/// How the platform is identified.
struct PlatformCampaign {
  bool level = true;  ///< the rolls are read; else they are taken as zero, as Peng did
  bool choose_orders = false;
  double below = 0.0;     ///< mm, of every reflector under the tool's tip
  std::string roll = "";  ///< TOML of a roll beside Peng's elements
};

/// RMS over the cut volume of each part.
struct PlatformResult {
  double worst_truth = 0.0;
  double worst_left = 0.0;
  bool warned = false;  ///< that the readings scatter more than their instruments
};

PlatformResult platform(const PlatformCampaign& how) {
  const SceneFolder folder;
  const auto errors = packaged("errors/platform_peng.toml").string();
  const auto roll = folder.write("roll.toml", how.roll);
  const Scene scene = read_scene(packaged("platform_calibration.toml"),
                                 {{"errors", "[\"" + errors + "\", \"" + roll.string() + "\"]"}});
  std::vector<InstrumentDescription> instruments;
  for (const InstrumentDescription& one : scene.instruments)
    if (how.level || one.instrument.kind != errors::metrology::Kind::Level)
      instruments.push_back(one);
  for (InstrumentDescription& one : instruments)
    one.instrument.reflector_t = Vector3d(0, how.below, 0);  // y of the tool is down
  IdentificationOptions options;
  options.model.order = 16;
  options.model.only = {"EXX", "EYX", "EZX", "EBX", "ECX", "EXZ",
                        "EYZ", "EZZ", "EAZ", "EBZ", "EB0Z"};
  options.choose_orders = how.choose_orders;
  if (how.level) options.model.only.insert(options.model.only.end(), {"EAX", "ECZ"});
  options.out = folder.path() / "belief.toml";
  const Json report = to_json(identify(campaign(scene, instruments, folder), options));
  const errors::GeometricErrors belief = belief_in(options.out, "platform_calibration.toml");
  PlatformResult result;
  result.warned = !report["warnings"].empty();
  for (const char* part : {"platform_plane.toml", "platform_cone.toml", "platform_sphere.toml"}) {
    const auto poses = poses_of_part(part);
    const VectorXd is = axial_error(scene.geometric, poses), believed = axial_error(belief, poses);
    std::cout << fmt::format("  {:22} e_x {:.3f} um RMS, identified minus true {:.4f} um\n", part,
                             rms(is) / 1.0_um, rms(believed - is) / 1.0_um);
    result.worst_truth = std::max(result.worst_truth, rms(is));
    result.worst_left = std::max(result.worst_left, rms(believed - is));
  }
  std::cout << fmt::format("  {:.1f} hours, chi-square {:.3f}, {} confounded\n",
                           report["hours"].get<double>(),
                           report["reduced_chi_square"].get<double>(), report["confounded"].size());
  return result;
}

TEST(Identify, PengsPlatformIsKnownToAThirdOfAMicrometre) {
  std::cout << "laser, straightness, angles, square and a level:\n";
  const PlatformResult all = platform({});
  EXPECT_GT(all.worst_truth, 0.5_um);
  EXPECT_LT(all.worst_left, 0.3_um);
}

// Where the lines are read at the tip, its roll is in what they read; off that line it is not.
TEST(Identify, RollTakenAsZeroCostsNothingAtTheTipAndItsWholeArmBelow) {
  std::cout << "without roll, taken as zero:\n";
  EXPECT_LT(platform({.level = false}).worst_left, 0.3_um);
  const std::string roll =
      "ECZ = { kind = \"legendre\", coefficients_urad = [0, 75], centre_mm = 30, "
      "half_range_mm = 50 }\n";
  std::cout << "with a roll of 150 urad over 100 mm, taken as zero, read at the tip:\n";
  EXPECT_LT(platform({.level = false, .roll = roll}).worst_left, 0.3_um);
  std::cout << "read 60 mm below it, level used:\n";
  EXPECT_LT(platform({.below = 60, .roll = roll}).worst_left, 0.3_um);
  std::cout << "the same, taken as zero:\n";
  const double cost = platform({.level = false, .below = 60, .roll = roll}).worst_left;
  // 1.5 urad/mm over the 10.8 mm that are cut: 60 mm x 16.2 urad / sqrt(12) on a plane
  const double by_hand = 60.0 * 1.5e-6 * 10.8 / std::sqrt(12.0);
  std::cout << "cost by hand " << by_hand / 1.0_um << " um\n";
  EXPECT_NEAR(cost, by_hand, 0.3 * by_hand);
}

TEST(Identify, OrdersChosenUpToTenSayThatTheyMissAWaveOf33mm) {
  std::cout << "orders chosen, at most 10:\n";
  const PlatformResult chosen = platform({.choose_orders = true});
  EXPECT_TRUE(chosen.warned);
  EXPECT_LT(chosen.worst_left, 0.3_um);
  EXPECT_FALSE(platform({}).warned);
}

// ---------------------------------------------------------------- the gantry

/// Errors at many poses: rows of tip (mm), then of the axis (rad).
struct Volume {
  Eigen::MatrixX3d tip, axis;
};

/// What a rigid placing of the workpiece and a lean of the tool, the same everywhere, do not
/// explain: no reading tells where the frame of the workpiece is, and of the nose's lean only what
/// the arms of balls are known to.
Volume placed(const Volume& errors, const kinematics::Chain& nominal,
              const std::vector<AxisState>& poses, bool lean) {
  const auto n = Index(poses.size());
  const double length = 100.0;  // mm, makes rad count beside mm
  MatrixXd A = MatrixXd::Zero(6 * n, lean ? 8 : 6);
  VectorXd y(6 * n);
  for (Index i = 0; i < n; ++i) {
    const kinematics::Pose T_wt = nominal.tool_in_workpiece(poses[std::size_t(i)].q);
    for (int k = 0; k < 3; ++k) {
      A(6 * i + k, k) = 1.0;
      A.block<3, 1>(6 * i, 3 + k) = Vector3d::Unit(k).cross(T_wt.translation());
      A.block<3, 1>(6 * i + 3, 3 + k) = length * Vector3d::Unit(k).cross(T_wt.linear().col(2));
      if (lean && k < 2) A.block<3, 1>(6 * i + 3, 6 + k) = length * T_wt.linear().col(k);
    }
    y.segment<3>(6 * i) = errors.tip.row(i).transpose();
    y.segment<3>(6 * i + 3) = length * errors.axis.row(i).transpose();
  }
  const VectorXd left = y - A * least_squares(A, y).x;
  Volume result{Eigen::MatrixX3d(n, 3), Eigen::MatrixX3d(n, 3)};
  for (Index i = 0; i < n; ++i) {
    result.tip.row(i) = left.segment<3>(6 * i).transpose();
    result.axis.row(i) = left.segment<3>(6 * i + 3).transpose() / length;
  }
  return result;
}

double rms_of(const Eigen::MatrixX3d& m) { return std::sqrt(m.squaredNorm() / double(m.rows())); }

constexpr unsigned gantry_seed = 20261124;

std::vector<AxisState> random_poses(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1);
  std::vector<AxisState> poses(1000);
  for (AxisState& pose : poses) {
    pose.q.resize(6);
    pose.q << pi * any(random), 270 * any(random), 315 * any(random), 150 + 180 * any(random),
        90.0_deg * any(random), 0.0;
    pose.direction.fill(1);
  }
  return poses;
}

/// RMS over the poses, mm and rad, of the truth and of what a belief leaves of it.
struct GantryResult {
  double tip_from_datum = 0.0, tip_from_datum_left = 0.0;  ///< minus the error at one pose
  double tip = 0.0, tip_left = 0.0;                        ///< the workpiece placed
  double axis = 0.0, axis_left = 0.0;                      ///< the workpiece placed
  double lean = 0.0, lean_left = 0.0;  ///< of the axis, the nose's constant lean taken out, too
};

GantryResult gantry_result(const char* how, IdentificationOptions options) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_calibration.toml"));
  const auto nominal = make_machine(scene).nominal;
  options.out = folder.path() / "belief.toml";
  const Json report = to_json(identify(campaign(scene, scene.instruments, folder), options));
  const auto truth = errors::bind(scene.geometric, nominal);
  const auto belief = errors::bind(belief_in(options.out, "gantry_calibration.toml"), nominal);
  const std::vector<AxisState> poses = random_poses(gantry_seed);
  const auto n = Index(poses.size());
  Volume is{Eigen::MatrixX3d(n, 3), Eigen::MatrixX3d(n, 3)}, left = is;
  for (Index i = 0; i < n; ++i) {
    const auto e = error_at(nominal, truth, poses[std::size_t(i)]);
    const auto b = error_at(nominal, belief, poses[std::size_t(i)]);
    is.tip.row(i) = e.head<3>().transpose();
    is.axis.row(i) = e.tail<3>().transpose();
    left.tip.row(i) = (e - b).head<3>().transpose();
    left.axis.row(i) = (e - b).tail<3>().transpose();
  }
  AxisState datum = poses.front();
  datum.q << 0, 0, 0, 150, 0, 0;
  const Eigen::RowVector3d is_0 = error_at(nominal, truth, datum).head<3>().transpose();
  const Eigen::RowVector3d left_0 = is_0 - error_at(nominal, belief, datum).head<3>().transpose();
  GantryResult r;
  r.tip_from_datum = rms_of(is.tip.rowwise() - is_0);
  r.tip_from_datum_left = rms_of(left.tip.rowwise() - left_0);
  r.tip = rms_of(placed(is, nominal, poses, false).tip);
  r.tip_left = rms_of(placed(left, nominal, poses, false).tip);
  r.axis = rms_of(placed(is, nominal, poses, false).axis);
  r.axis_left = rms_of(placed(left, nominal, poses, false).axis);
  r.lean = rms_of(placed(is, nominal, poses, true).axis);
  r.lean_left = rms_of(placed(left, nominal, poses, true).axis);
  std::cout << fmt::format(
      "{}: chi-square {:.2f}, {:.1f} hours, {} of {} numbers found\n"
      "  tip, counted from one datum pose:     {:8.3f} um RMS, left {:8.3f}\n"
      "  tip, the workpiece placed:            {:8.3f} um RMS, left {:8.3f}\n"
      "  axis, the workpiece placed:           {:8.3f} urad RMS, left {:8.3f}\n"
      "  axis, the nose's constant lean aside: {:8.3f} urad RMS, left {:8.3f}\n  confounded:",
      how, report["reduced_chi_square"].get<double>(), report["hours"].get<double>(),
      report["found"].get<int>(), report["unknowns"].get<int>(), r.tip_from_datum / 1.0_um,
      r.tip_from_datum_left / 1.0_um, r.tip / 1.0_um, r.tip_left / 1.0_um, r.axis / 1.0_urad,
      r.axis_left / 1.0_urad, r.lean / 1.0_urad, r.lean_left / 1.0_urad);
  for (const Json& one : report["confounded"]) std::cout << " " << one["name"].get<std::string>();
  std::cout << "\n";
  return r;
}

// What only tilts the workpiece on its table is held by the model, so the belief also serves a part
// whose datum is one pose. The screws' pitch (0.5 um a slide) is left where the curves lack it, and
// of the axis the lean of the nose, known to 1 um on arms of 120 mm.
TEST(Identify, TheCalibratedGantryIsKnownToATenth) {
  SCOPED_TRACE(testing::Message() << "seed " << gantry_seed);
  IdentificationOptions options;
  options.model.order = 6;
  const GantryResult smooth = gantry_result("order 6", options);
  options.model.pitch = {{'X', 16.0}, {'Y', 16.0}, {'Z', 12.0}};
  const GantryResult pitched = gantry_result("order 6 and the screws' pitch", options);
  for (const GantryResult& r : {smooth, pitched}) {
    EXPECT_LT(r.tip_from_datum_left, 0.1 * r.tip_from_datum);
    EXPECT_LT(r.tip_left, 0.1 * r.tip);
    EXPECT_LT(r.lean_left, 0.1 * r.lean);
  }
  EXPECT_LT(pitched.tip_left, smooth.tip_left);
}

}  // namespace
}  // namespace abbe::sim
