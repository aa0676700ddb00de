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
  std::string path;  ///< a path as in --set: "errors.EXX.0.coefficients_um.1"
  double factor = 1.0;
};

/// An uncertain quantity of a study. It sets values of the scene by path, or changes the curves of
/// the scene's geometric errors: as a factor of all curves of one element, or as one coefficient of
/// one curve.
struct Input {
  std::string name;
  std::string unit;  ///< "um", "urad" or the unit of the path's key; empty for a factor
  std::vector<Setting> settings;
  std::string element;  ///< "EXX": the input is a factor of that element as the scene states it
  std::string number;   ///< "EXX[1]", errors::name_of: the input is that coefficient of a curve, um
                        ///< or urad
  Distribution distribution;
  double cost = 1.0;  ///< cost of the present spread; a k-th of the spread costs k times as much
};

/// A coefficient of the machine's errors that its belief does not hold.
struct Unidentified {
  std::string number;   ///< "EY0A", "EAX[1]"
  std::string unit;     ///< "um", "urad"
  double spread = 0.0;  ///< standard deviation of its prior if it is drawn, else the typical one of
                        ///< its kind; its effect on the map is stated for this spread
  bool is_drawn = false;  ///< it has a prior, so an input represents it
  /// Coefficients of the belief that absorbed it, with the amount per unit of it.
  std::vector<std::pair<std::string, double>> hidden_by;
};

/// A machine whose part is judged in every case: the scene or one of its variants, uncompensated or
/// with one of its compensators.
struct Configuration {
  std::string name;       ///< "uncompensated", "3 h perfect-iterated-ideal"
  std::string variant;    ///< variant of the scene; empty: the scene itself
  std::string case_name;  ///< "uncompensated" or a compensator
};

/// A scalar figure of a residual map; lengths in mm.
enum class Response {
  Pv,
  Rms,
  Mean,
  Std,
  MaxAbs,
  P95Abs,
  InTolerance,
  FormPv,  ///< PV of the form: the map after the areal filter
  FormRms,
  TextureSa,  ///< Sa of the texture: what the filter removes, ISO 25178-2
  TextureSq,
  TextureSz,
};
inline constexpr std::array all_responses{
    Response::Pv,      Response::Rms,       Response::Mean,        Response::Std,
    Response::MaxAbs,  Response::P95Abs,    Response::InTolerance, Response::FormPv,
    Response::FormRms, Response::TextureSa, Response::TextureSq,   Response::TextureSz};
const char* name_of(Response response);  ///< returns "pv" etc.
/// Returns the unit of the response as shown, "um" or "%".
const char* unit_of(Response response);
/// Converts a value from mm (or percent) to the unit of `unit_of`.
double in_unit(Response response, double value);
/// Returns true if the response is of form or texture, for which the map is filtered.
bool is_filtered(Response response);

/// Method by which cases are computed.
enum class Engine {
  Influence,  ///< every case from influence maps
  Full,       ///< every case cut
  Both,       ///< influence maps, and some of the cases cut in full to verify them
};

/// Analysis that changes one input at a time.
struct OneAtATime {
  double step = 1.0;  ///< standard deviations to either side of the centre
};
/// Analysis by random machines.
struct MonteCarlo {
  std::uint64_t cases = 1000;
  Sampling sampling = Sampling::Sobol;
};
/// Analysis by Sobol indices: base_points x (inputs + 2) cases.
struct SobolStudy {
  std::uint64_t base_points = 1024;
};
/// Analysis that steps one input through values, all others at their centres.
struct Sweep {
  int input = 0;
  Eigen::VectorXd values;  ///< (n >= 1)
};
/// Analysis that searches the worst corner of all inputs.
struct WorstCase {
  double coverage = 3.0;  ///< standard deviations, used where a distribution is unbounded
};
/// Limit of a response; the analysis finds the spreads of the inputs that keep it.
struct Tolerance {
  Response response = Response::Pv;
  double limit = 0.0;  ///< mm
  double confidence = 0.95;
  std::uint64_t machines = 4000;  ///< drawn to find the spreads, and as many fresh ones to verify
                                  ///< them
};
/// Options of the uncertainty map: the band of the residual due to the spread of the inputs.
struct Uncertainty {
  double confidence = 0.95;
  std::uint64_t machines = 2000;
};
/// Options for computing, checking and drawing influence maps.
struct InfluenceOptions {
  double reach = 0.05;  ///< mm, competing passes within this distance of the first one are kept
  int max_rivals = 6;
  int checks = 4;      ///< random machines that are cut in full to find where the maps fail
  double flag = 2e-4;  ///< mm, a vertex that differs by more in any of them is flagged
  bool sheet = true;   ///< draws all inputs on one sheet
  std::vector<std::string> pictures;  ///< inputs that also get a picture of their own
};
/// Days on which a thermal belief is learnt, and days on which it is judged.
struct Histories {
  std::vector<std::string> train;  ///< variants; "" is the day of the scene itself
  std::vector<std::string> test;
  std::string case_name = "thermal-iterated-ideal";
};

/// A study as read from its file: description only.
struct Study {
  std::filesystem::path file;
  std::string title;
  std::filesystem::path scene;
  std::shared_ptr<const Node> scene_tree;  ///< the scene as it was when the study was read, without
  std::vector<Variant> variants;           ///< of that scene
  std::vector<Override> overrides;         ///< applied to the scene before any input
  Engine engine = Engine::Influence;
  std::uint64_t seed = 1;
  std::vector<Configuration> arms;  ///< (>= 1)
  std::vector<Response> responses;  ///< (>= 1)
  bool machine_part = false;        ///< responses are those of the map minus the error-free map
  std::vector<std::pair<Response, double>> limits;  ///< mm, upper limits
  std::vector<Input> inputs;
  std::vector<Unidentified> unidentified;   ///< coefficients missing from a belief whose covariance
                                            ///< is drawn
  std::vector<errors::Element> completion;  ///< elements at zero that the scene lacks and that hold
                                            ///< unidentified coefficients
  Copula copula{0};                         ///< joint distribution of the inputs
  InfluenceOptions influence;
  std::uint64_t proofs = 50;  ///< cases that engine `both` also cuts in full
  std::optional<OneAtATime> one_at_a_time;
  std::optional<MonteCarlo> monte_carlo;
  std::optional<SobolStudy> sobol;
  std::vector<Sweep> sweeps;
  std::optional<WorstCase> worst_case;
  std::optional<Tolerance> tolerance;
  std::optional<Uncertainty> uncertainty;
  std::optional<Histories> histories;
  std::vector<std::filesystem::path> files;    ///< files that the study was read from or names
  std::vector<NamedProgram> programs;          ///< programs that the study and its scene would run
  std::vector<std::filesystem::path> trusted;  ///< programs that it may run
  std::string text;  ///< the study's own TOML as understood, with the absolute path of its scene
  std::string identity;  ///< checksum of study, scenes, the files they name and the abbe build; a
                         ///< journal with another identity belongs to another study
};

/// Reads a study and its scene as strictly as read_scene, and sets the path of every input once to
/// check it.
/// @param overrides  of the study file's own values (--set)
/// @throws BadScene with every input error
Study read_study(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// Reads a study and trusts the programs that `permissions` allow.
/// @throws BadScene also if the study names a program that is not trusted
Study read_trusted_study(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions);

/// Returns true if the TOML file is a study, i.e. has a `scene` key. Returns false if the file
/// cannot be parsed.
bool is_study(const std::filesystem::path& file);

/// Returns the values of the inputs at the centres of their distributions: the base machine.
/// (inputs)
Eigen::VectorXd centre(const Study& study);
/// Returns the standard deviations of the inputs. (inputs)
Eigen::VectorXd spreads(const Study& study);

/// Returns the study with its scene read, once for all its cases.
/// @throws BadScene
Study load_scene(Study study);

/// Returns the scene of a configuration before any input is set. The scene of the study must be
/// loaded.
/// @throws BadScene
Scene scene_of(const Study& study, const Configuration& arm);

/// Returns the scene of a configuration with the inputs at x; it keeps only the case of that
/// configuration.
/// @param base  the scene that scene_of returns for the configuration
/// @throws BadScene
Scene scene_at(const Study& study, const Configuration& arm, const Scene& base,
               const Eigen::VectorXd& x);

/// Returns true if an input changes part, program, nominal machine or tool, or how the stock is
/// tracked, so that its cases share no computation. All other inputs change the errors only.
bool is_reshaping(const Input& input);

}  // namespace abbe::sim::study
