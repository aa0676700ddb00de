#include "sim/study/study.h"

#include <algorithm>
#include <array>
#include <cctype>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "kinematics/units.h"
#include "sim/scene/document.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/toml.h"

namespace abbe::sim::study {
namespace {

struct ResponseName {
  Response response;
  const char* name;
};
constexpr std::array response_names{ResponseName{Response::Pv, "pv"},
                                    ResponseName{Response::Rms, "rms"},
                                    ResponseName{Response::Mean, "mean"},
                                    ResponseName{Response::Std, "std"},
                                    ResponseName{Response::MaxAbs, "max_abs"},
                                    ResponseName{Response::P95Abs, "p95_abs"},
                                    ResponseName{Response::InTolerance, "in_tolerance"},
                                    ResponseName{Response::FormPv, "form_pv"},
                                    ResponseName{Response::FormRms, "form_rms"},
                                    ResponseName{Response::TextureSa, "texture_sa"},
                                    ResponseName{Response::TextureSq, "texture_sq"},
                                    ResponseName{Response::TextureSz, "texture_sz"}};

std::string top_key(const std::string& path) { return path.substr(0, path.find('.')); }

/// Multiplies all curves of an element by a factor.
void scale_element(std::vector<errors::Element>& elements, const std::string& name, double factor) {
  for (errors::Element& element : elements) {
    if (errors::to_string(element.name) != name) continue;
    for (errors::Curve& curve : element.curves) curve.scale *= factor;
  }
}

/// Sets the coefficients of curves to the values of their inputs, in a single pass.
void set_coefficients(const Study& study, const Eigen::VectorXd& x,
                      errors::GeometricErrors& errors) {
  const std::vector<errors::Coefficient> coefficients = errors::coefficients(errors.elements);
  Eigen::VectorXd values = errors::values(errors.elements);
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    const std::string name = errors::name_of(coefficients[k], errors.elements);
    const bool is_angle = errors.elements[std::size_t(coefficients[k].element)].name.is_angle();
    for (std::size_t i = 0; i < study.inputs.size(); ++i)
      if (study.inputs[i].number == name)
        values[Eigen::Index(k)] = x[Eigen::Index(i)] * (is_angle ? units::urad : units::um);
  }
  errors.elements = errors::with_values(std::move(errors.elements), values);
}

/// Returns the changes of the scene by the variant of a configuration.
/// @throws BadScene if the scene has no such variant
std::vector<Override> variant_overrides(const Study& study, const Configuration& configuration) {
  if (configuration.variant.empty()) return {};
  std::string known_names;
  for (const Variant& variant : study.variants) {
    if (variant.name == configuration.variant) return variant.set;
    known_names += (known_names.empty() ? "\"" : ", \"") + variant.name + "\"";
  }
  throw BadScene({BadInput(study.scene.string(), 0, 0,
                           known_names.empty() ? "no variant, because the scene has none"
                                               : "the name of a variant: " + known_names,
                           "\"" + configuration.variant + "\"")});
}

}  // namespace

const char* name_of(Response response) {
  return std::find_if(response_names.begin(), response_names.end(),
                      [&](const ResponseName& entry) { return entry.response == response; })
      ->name;
}

const char* name_of(Engine engine) {
  switch (engine) {
    case Engine::Influence:
      return "influence";
    case Engine::Full:
      return "full";
    case Engine::Both:
      return "both";
  }
  return "";
}

const char* unit_of(Response response) { return response == Response::InTolerance ? "%" : "um"; }

bool is_filtered(Response response) {
  return response == Response::FormPv || response == Response::FormRms ||
         response == Response::TextureSa || response == Response::TextureSq ||
         response == Response::TextureSz;
}

double in_unit(Response response, double value) {
  return response == Response::InTolerance ? value : value / units::um;
}

Eigen::VectorXd centre(const Study& study) {
  Eigen::VectorXd x(Eigen::Index(study.inputs.size()));
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x[i] = study.inputs[std::size_t(i)].distribution.centre;
  return x;
}

Eigen::VectorXd spreads(const Study& study) {
  Eigen::VectorXd x(Eigen::Index(study.inputs.size()));
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x[i] = moments(study.inputs[std::size_t(i)].distribution).standard_deviation;
  return x;
}

Study load_scene(Study study) {
  InputErrors input_errors;
  std::optional<Node> tree = read_tree(study.scene, input_errors);
  if (!tree) throw BadScene(input_errors.list());
  Scene scene = scene_from_tree(*tree, study.scene, study.overrides, input_errors);
  study.variants = std::move(scene.variants);
  const sim::NamedFiles named_files = collect_named_files(*scene.tree, study.scene);
  study.files.insert(study.files.end(), named_files.files.begin(), named_files.files.end());
  study.programs.insert(study.programs.end(), named_files.programs.begin(),
                        named_files.programs.end());
  // Otherwise the variants would be read again for every case.
  std::erase_if(*tree->table(), [](const Node::Entry& entry) { return entry.key == "variant"; });
  study.scene_tree = std::make_shared<const Node>(std::move(*tree));
  return study;
}

Scene base_scene(const Study& study, const Configuration& configuration) {
  return scene_at(study, configuration, {}, {});
}

Scene scene_at(const Study& study, const Configuration& configuration, const Scene& base,
               const Eigen::VectorXd& x) {
  const bool sets_paths = std::any_of(study.inputs.begin(), study.inputs.end(),
                                      [](const Input& input) { return !input.settings.empty(); });
  Scene scene = base;
  if (x.size() == 0 || sets_paths) {
    std::vector<Override> overrides = study.overrides;
    for (const Override& change : variant_overrides(study, configuration))
      overrides.push_back(change);
    for (Eigen::Index i = 0; i < x.size(); ++i)
      for (const Setting& setting : study.inputs[std::size_t(i)].settings)
        // `{}` prints the shortest text that reads back to the same bits; integers stay integers.
        overrides.push_back({setting.path, fmt::format("{}", setting.factor * x[i])});
    scene = scene_from_tree(*study.scene_tree, study.scene, overrides);
    scene.trusted = study.trusted;
    scene.geometric.elements.insert(scene.geometric.elements.end(), study.completion.begin(),
                                    study.completion.end());
  }
  if (x.size() == 0) return scene;
  set_coefficients(study, x, scene.geometric);
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (const Input& input = study.inputs[std::size_t(i)]; !input.element.empty())
      scale_element(scene.geometric.elements, input.element, x[i]);
  return scene;
}

std::string path_without_indices(const std::string& path) {
  std::string key;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t dot = std::min(path.find('.', begin), path.size());
    const std::string component = path.substr(begin, dot - begin);
    if (!std::ranges::all_of(component, [](unsigned char c) { return std::isdigit(c) != 0; }))
      key += (key.empty() ? "" : ".") + component;
    begin = dot + 1;
  }
  return key;
}

bool is_reshaping(const Input& input) {
  // Tables that change only errors. All others change part, program, nominal machine or stock.
  constexpr std::array error_only_keys{
      "errors",  "setup",     "thermal", "history",    "room",         "room_C", "datum",
      "control", "vibration", "belief",  "compliance", "compensation", "signals"};
  return std::any_of(input.settings.begin(), input.settings.end(), [&](const Setting& setting) {
    const std::string path = path_without_indices(setting.path);  // a tool may have an index
    if (path.starts_with("tool.actual.") || path.starts_with("tool.wear.") ||
        path.starts_with("tool.compliance."))
      return false;
    return std::ranges::find(error_only_keys, top_key(path)) == error_only_keys.end();
  });
}

}  // namespace abbe::sim::study
