#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "errors/element.h"
#include "sim/files/output.h"
#include "sim/scene/document.h"
#include "sim/study/sampling.h"

namespace abbe::sim {
struct Node;
struct Scene;
}  // namespace abbe::sim

namespace abbe::sim::study {

/// A value of the scene that an input sets: `factor` times the input, in the unit of the path's
/// key.
struct Setting {
  std::string path;  ///< as of --set: "errors.EXX.0.coefficients_um.1"
  double factor = 1.0;
};

/// One thing that nobody knows exactly. It acts through paths, or on the curves of the scene's
/// geometric errors: as a factor of all curves of an element, or as one number of one curve.
struct Input {
  std::string name;
  std::string unit;  ///< "um", "urad", of the path's key; empty for a factor
  std::vector<Setting> settings;
  std::string element;  ///< "EXX": a factor of that element as the scene has it
  std::string number;   ///< "EXX[1]", errors::name_of: a number of a curve, um or urad
  Distribution distribution;
  double cost = 1.0;  ///< of its present spread; a k-th of the spread costs k times as much
};

/// A number of the machine's errors that its belief does not hold.
struct Unidentified {
  std::string number;   ///< "EY0A", "EAX[1]"
  std::string unit;     ///< "um", "urad"
  double spread = 0.0;  ///< standard deviation of its prior where it is drawn, else the typical one
                        ///< of its kind, by which its effect is stated
  bool is_drawn = false;  ///< it has a prior, so that an input stands for it
  /// Numbers of the belief that took on so much of each unit of it.
  std::vector<std::pair<std::string, double>> hidden_by;
};

/// A machine whose part is judged in every case: the scene or one of its variants, as it is or with
/// one of its compensators.
struct Configuration {
  std::string name;       ///< "uncompensated", "3 h perfect-iterated-ideal"
  std::string variant;    ///< of the scene; empty: the scene itself
  std::string case_name;  ///< "uncompensated" or a compensator
};

/// A figure of a map; lengths in mm.
enum class Response {
  Pv,
  Rms,
  Mean,
  Std,
  MaxAbs,
  P95Abs,
  InTolerance,
  FormPv,  ///< of the map through the areal filter
  FormRms,
  TextureSa,  ///< of what the filter leaves out, ISO 25178-2
  TextureSq,
  TextureSz,
};
inline constexpr std::array all_responses{
    Response::Pv,      Response::Rms,       Response::Mean,        Response::Std,
    Response::MaxAbs,  Response::P95Abs,    Response::InTolerance, Response::FormPv,
    Response::FormRms, Response::TextureSa, Response::TextureSq,   Response::TextureSz};
const char* name_of(Response response);  ///< "pv" ...
/// "um" or "%", and the factor from mm (or percent) to it.
const char* unit_of(Response response);
double in_unit(Response response, double value);
/// Whether a response is one of form or texture, for which the map is filtered.
bool is_filtered(Response response);

enum class Engine {
  Influence,  ///< every case from influence maps
  Full,       ///< every case cut
  Both,       ///< influence maps, and some of the cases cut to prove them
};

struct OneAtATime {
  double step = 1.0;  ///< standard deviations to either side
};
struct MonteCarlo {
  std::uint64_t cases = 1000;
  Sampling sampling = Sampling::Sobol;
};
struct SobolStudy {
  std::uint64_t base_points = 1024;
};
struct Sweep {
  int input = 0;
  Eigen::VectorXd values;  ///< (n >= 1)
};
struct WorstCase {
  double coverage = 3.0;  ///< standard deviations, where a distribution has no end
};
/// How good every input must be.
struct Tolerance {
  Response response = Response::Pv;
  double limit = 0.0;  ///< mm
  double confidence = 0.95;
  std::uint64_t machines = 4000;  ///< drawn to find the spreads, and as many fresh ones to verify
};
/// Maps of what one does not know.
struct Uncertainty {
  double confidence = 0.95;
  std::uint64_t machines = 2000;
};
/// How influence maps are made, checked and shown.
struct InfluenceOptions {
  double reach = 0.05;  ///< mm, rival passes within so much of the first one are kept
  int max_rivals = 6;
  int checks = 4;      ///< random machines that are cut to find where the maps fail
  double flag = 2e-4;  ///< mm, a vertex that differs by more in one of them is flagged
  bool sheet = true;   ///< all inputs on one sheet
  std::vector<std::string> pictures;  ///< inputs that get a map of their own
};
/// A thermal belief learnt on some days, judged on others.
struct Histories {
  std::vector<std::string> train;  ///< variants; "" is the scene's own day
  std::vector<std::string> test;
  std::string case_name = "thermal-iterated-ideal";
};

/// A study as read: description only.
struct Study {
  std::filesystem::path file;
  std::string title;
  std::filesystem::path scene;
  std::shared_ptr<const Node> scene_tree;  ///< the scene as it was when the study was read, without
                                           ///< its variants
  std::vector<Variant> variants;           ///< of that scene
  std::vector<Override> overrides;         ///< of the scene, before any input
  Engine engine = Engine::Influence;
  std::uint64_t seed = 1;
  std::vector<Configuration> arms;  ///< (>= 1)
  std::vector<Response> responses;  ///< (>= 1)
  bool machine_part = false;        ///< figures are of the map minus the error-free one
  std::vector<std::pair<Response, double>> limits;  ///< mm, upper ones
  std::vector<Input> inputs;
  std::vector<Unidentified> unidentified;   ///< of a belief whose covariance is drawn
  std::vector<errors::Element> completion;  ///< elements at zero, beside those of the scene, which
                                            ///< hold numbers that are unidentified
  Copula copula{0};                         ///< how the inputs vary together
  InfluenceOptions influence;
  std::uint64_t proofs = 50;  ///< cases that engine `both` cuts as well
  std::optional<OneAtATime> one_at_a_time;
  std::optional<MonteCarlo> monte_carlo;
  std::optional<SobolStudy> sobol;
  std::vector<Sweep> sweeps;
  std::optional<WorstCase> worst_case;
  std::optional<Tolerance> tolerance;
  std::optional<Uncertainty> uncertainty;
  std::optional<Histories> histories;
  std::vector<std::filesystem::path> files;    ///< that it was read from or names
  std::vector<NamedProgram> programs;          ///< that it and its scene would run
  std::vector<std::filesystem::path> trusted;  ///< those that it may run
  std::string text;      ///< the study's own TOML as it was understood, its scene by absolute path
  std::string identity;  ///< of study, scenes, the files they name and the program: a journal of
                         ///< another identity is another study's
};

/// Reads a study strictly, as read_scene does, the scene with it: every input's path is tried.
/// @param overrides  of the study file's own values (--set), as of a scene
/// @throws BadScene with every fault
Study read_study(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// The same with its programs trusted. @throws BadScene also where they are not
Study read_trusted_study(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions);

/// Whether a TOML file says that it is a study: it names a scene. What cannot be read is none.
bool is_study(const std::filesystem::path& file);

/// Values of the inputs at the centres of their distributions: the base machine. (inputs)
Eigen::VectorXd centre(const Study& study);
/// Standard deviations of the inputs. (inputs)
Eigen::VectorXd spreads(const Study& study);

/// The study with its scene read, once and for all its cases.
/// @throws BadScene
Study load_scene(Study study);

/// The scene of an arm as it is before any input; of a study whose scene was read.
/// @throws BadScene
Scene scene_of(const Study& study, const Configuration& arm);

/// The same with its inputs at x, the cases of the arm alone in it.
/// @param base  scene_of the arm
/// @throws BadScene
Scene scene_at(const Study& study, const Configuration& arm, const Scene& base,
               const Eigen::VectorXd& x);

/// Whether an input changes part, program, nominal machine or tool, or how the stock is followed,
/// so that its cases share nothing; else it only changes what is wrong.
bool is_reshaping(const Input& input);

}  // namespace abbe::sim::study
