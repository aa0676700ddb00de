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

/// A value of the scene that is set to `factor` times an input, in the unit of the path's key.
struct Setting {
  std::string path;  ///< a path as in --set: "errors.EXX.0.coefficients_um.1"
  double factor = 1.0;
};

/// An uncertain quantity of a study. It sets values of the scene by path, scales all curves of one
/// element of the scene's geometric errors, or sets one coefficient of one of their curves.
struct Input {
  std::string name;
  std::string unit;  ///< "um", "urad" or the unit of the path's key; empty for a factor
  std::vector<Setting> settings;
  std::string element;  ///< element that it scales, such as "EXX"; empty if none
  std::string number;  ///< coefficient that it sets, um or urad, such as "EXX[1]" (errors::name_of)
  Distribution distribution;
  double cost = 1.0;  ///< cost of the present spread; 1/k of the spread costs k times as much
};

/// A coefficient of the machine's errors that its belief does not contain.
struct UnidentifiedCoefficient {
  std::string number;     ///< such as "EY0A" or "EAX[1]"
  std::string unit;       ///< "um" or "urad"
  double spread = 0.0;    ///< standard deviation of its prior, or else the typical one of such a
                          ///< coefficient; its effect on the map is stated for this spread
  bool is_drawn = false;  ///< true: it has a prior, and an input represents it
  /// Coefficients of the belief that absorbed it, with their amounts per unit of it.
  std::vector<std::pair<std::string, double>> hidden_by;
};

/// A machine whose part is evaluated in every case: the scene or one of its variants, uncompensated
/// or with one of its compensators.
struct Configuration {
  std::string name;       ///< such as "uncompensated" or "3 h perfect-iterated-ideal"
  std::string variant;    ///< variant of the scene; empty: the scene itself
  std::string case_name;  ///< "uncompensated" or a compensator
};

/// Scalar figures of a residual map; lengths in mm.
enum class Response {
  Pv,
  Rms,
  Mean,
  Std,
  MaxAbs,
  P95Abs,
  InTolerance,
  FormPv,  ///< PV of the form, i.e. of the map after the areal filter
  FormRms,
  TextureSa,  ///< Sa of the texture, i.e. of the map minus its form (ISO 25178-2)
  TextureSq,
  TextureSz,
};
inline constexpr std::array all_responses{
    Response::Pv,      Response::Rms,       Response::Mean,        Response::Std,
    Response::MaxAbs,  Response::P95Abs,    Response::InTolerance, Response::FormPv,
    Response::FormRms, Response::TextureSa, Response::TextureSq,   Response::TextureSz};
/// Returns the name of a response for files: "pv" etc.
const char* name_of(Response response);
/// Returns the unit of a response in files: "um" or "%".
const char* unit_of(Response response);
/// Converts a value from mm (or percent) to the unit of `unit_of`.
double in_unit(Response response, double value);
/// Returns true if the response is one of form or texture, for which the map is filtered.
bool is_filtered(Response response);

/// Method by which cases are computed.
enum class Engine {
  Influence,  ///< every case from influence maps
  Full,       ///< every case cut
  Both,       ///< influence maps, and some of the cases cut in full to verify them
};
/// Returns the name of an engine for files: "influence", "full" or "both".
const char* name_of(Engine engine);

/// Analysis that changes one input at a time.
struct OneAtATime {
  double step = 1.0;  ///< standard deviations to either side of the centre
};
/// Analysis of random machines.
struct MonteCarlo {
  std::uint64_t cases = 1000;
  Sampling sampling = Sampling::Sobol;
};
/// Analysis by Sobol indices, which needs base_points x (inputs + 2) cases.
struct SobolAnalysis {
  std::uint64_t base_points = 1024;
};
/// Analysis that steps one input through values while all others are at their centres.
struct Sweep {
  int input = 0;
  Eigen::VectorXd values;  ///< (n >= 1)
};
/// Analysis that searches for the worst corner of all inputs.
struct WorstCase {
  double coverage = 3.0;  ///< range of an unbounded distribution, standard deviations
};
/// Analysis that finds the spreads of the inputs with which a response stays within a limit.
struct Tolerance {
  Response response = Response::Pv;
  double limit = 0.0;  ///< mm
  double confidence = 0.95;
  std::uint64_t machines = 4000;  ///< random machines that determine the spreads; the same number
                                  ///< of other machines verifies them
};
/// Analysis of the uncertainty of the residual map due to the spread of the inputs.
struct Uncertainty {
  double confidence = 0.95;
  std::uint64_t machines = 2000;
};
/// Options for computing, checking and drawing influence maps.
struct InfluenceOptions {
  double reach = 0.05;  ///< mm, competing passes within this distance of the first one are kept
  int max_competing_passes = 6;    ///< competing passes kept at a vertex
  int checks = 4;                  ///< random machines that are cut in full to verify the maps
  double flag_threshold = 2e-4;    ///< mm, a vertex that differs by more in any of these is flagged
  bool has_overview_sheet = true;  ///< true: all inputs are drawn on a sheet
  std::vector<std::string> pictures;  ///< inputs that also get a picture of their own
};
/// Days on which a thermal belief is learnt, and days on which it is evaluated.
struct Histories {
  std::vector<std::string> train;  ///< variants; "" is the day of the scene itself
  std::vector<std::string> test;   ///< the same
  std::string case_name = "thermal-iterated-ideal";
};

/// A study as read from its file.
struct Study {
  std::filesystem::path file;
  std::string title;
  std::filesystem::path scene;
  std::shared_ptr<const Node> scene_tree;  ///< the scene when the study was read, without variants
  std::vector<Variant> variants;           ///< of the scene
  std::vector<Override> overrides;         ///< applied to the scene before any input
  Engine engine = Engine::Influence;
  std::uint64_t seed = 1;
  std::vector<Configuration> configurations;  ///< (>= 1)
  std::vector<Response> responses;            ///< (>= 1)
  bool subtracts_error_free_map =
      false;  ///< true: responses are of the map minus the error-free map
  std::vector<std::pair<Response, double>> limits;  ///< mm, upper limits
  std::vector<Input> inputs;
  std::vector<UnidentifiedCoefficient> unidentified;  ///< coefficients that a belief with drawn
                                                      ///< covariance does not contain
  std::vector<errors::Element> completion;  ///< elements at zero with unidentified coefficients,
                                            ///< which the scene lacks
  Copula copula{0};                         ///< joint distribution of the inputs
  InfluenceOptions influence;
  std::uint64_t verification_cases = 50;  ///< cases that engine `both` also cuts in full
  std::optional<OneAtATime> one_at_a_time;
  std::optional<MonteCarlo> monte_carlo;
  std::optional<SobolAnalysis> sobol;
  std::vector<Sweep> sweeps;
  std::optional<WorstCase> worst_case;
  std::optional<Tolerance> tolerance;
  std::optional<Uncertainty> uncertainty;
  std::optional<Histories> histories;
  std::vector<std::filesystem::path> files;    ///< its own files and those that it names
  std::vector<ProgramReference> programs;      ///< programs that the study and its scene would run
  std::vector<std::filesystem::path> trusted;  ///< programs that it may run
  std::string text;      ///< its TOML with all overrides and the absolute path of its scene
  std::string identity;  ///< checksum of study, scenes, the files they name and the abbe build; a
                         ///< journal with another identity belongs to another study
};

/// Reads a study and its scene as strictly as read_scene. To check the inputs, the path of each is
/// set once.
/// @param overrides  of values in the study file (--set)
/// @throws BadScene with all input errors
Study read_study(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// Reads a study and trusts the programs that `permissions` allow.
/// @throws BadScene also if the study names a program that is not trusted
Study read_trusted_study(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions);

/// Returns true if the TOML file is a study, i.e. has a `scene` key. Returns false if the file
/// cannot be parsed.
bool is_study(const std::filesystem::path& file);

/// Returns the centres of the inputs' distributions, which define the base machine. (inputs)
Eigen::VectorXd centre(const Study& study);
/// Returns the standard deviations of the inputs. (inputs)
Eigen::VectorXd spreads(const Study& study);

/// Returns the study with its scene, which is read once for all cases.
/// @throws BadScene
Study load_scene(Study study);

/// Returns a configuration's scene before any input is set. The study's scene must be loaded.
/// @throws BadScene
Scene base_scene(const Study& study, const Configuration& configuration);

/// Returns the scene of a configuration with the inputs at x and only its own case.
/// @param base  scene that `base_scene` returns for the configuration
/// @throws BadScene
Scene scene_at(const Study& study, const Configuration& configuration, const Scene& base,
               const Eigen::VectorXd& x);

/// Returns a path without its indices: "errors.EXX.coefficients_um" for
/// "errors.EXX.0.coefficients_um.1".
std::string path_without_indices(const std::string& path);

/// Returns true if an input changes part, program, nominal machine, nominal tool, or the tracking
/// of the stock, so that its cases cannot share computations. All other inputs change only the
/// errors.
bool is_reshaping(const Input& input);

}  // namespace abbe::sim::study
