#include "tests/figures/figure.h"
#include "sim/cut/judged_surface.h"
#include "sim/loop/compensate.h"
#include "sim/report/sensor_choice_report.h"
#include "sim/report/summary.h"
#include "sim/scene/read_scene.h"
#include "tests/test.h"

namespace abbe::figures {

using nlohmann::ordered_json;

std::string command(const SceneCase& one) {
  if (!one.variant.empty())
    return fmt::format("`abbe compare scenes/{}.toml`, `{}{}`", one.scene, one.variant,
                       one.case_name.empty() ? "" : "-" + one.case_name);
  std::string text = fmt::format("abbe run scenes/{}.toml", one.scene);
  for (const sim::Override& change : one.set) {
    const std::string &key = change.path, &value = change.value;
    const bool quoted = (key + value).find_first_of(" []{}\"") != std::string::npos;
    text += fmt::format(fmt::runtime(quoted ? " --set '{}={}'" : " --set {}={}"), key, value);
  }
  if (!one.case_name.empty()) text += " --case " + one.case_name;
  return "`" + text + "`";
}

sim::Scene scene_of(const std::string& name, const std::vector<sim::Override>& changes,
                    const std::string& variant) {
  const auto file = fs::path(ABBE_SOURCE_DIR) / "scenes" / (name + ".toml");
  const sim::Scene scene = sim::read_scene(file, changes);
  if (variant.empty()) return scene;
  for (const sim::Variant& one : scene.variants) {
    if (one.name != variant) continue;
    std::vector<sim::Override> all = changes;
    all.insert(all.end(), one.set.begin(), one.set.end());
    return sim::read_scene(file, all);
  }
  throw std::invalid_argument(name + " has no variant " + variant);
}

namespace {

/// A scene, compiled and sampled, with its error-free map.
struct ErrorFree {
  std::string command;
  sim::Job job;
  sim::Verdict verdict;
};

/// Returns that of the case's scene. The last one is kept: cases of one scene mostly follow each
/// other, and a map takes hundreds of MB.
const ErrorFree& error_free(const SceneCase& scene_case) {
  static std::optional<ErrorFree> last;
  std::string key = command({scene_case.scene, scene_case.set, "error_free", scene_case.variant});
  if (last && last->command == key) return *last;
  last.reset();
  sim::Job job =
      sim::sampled(sim::prepare(scene_of(scene_case.scene, scene_case.set, scene_case.variant)));
  sim::Verdict verdict = sim::judge(job, sim::cut_error_free(job), nullptr);
  return last.emplace(ErrorFree{std::move(key), std::move(job), std::move(verdict)});
}

}  // namespace

const ordered_json& summary_of(const SceneCase& scene_case) {
  static std::map<std::string, ordered_json> all;
  const std::string key = command(scene_case);
  if (const auto known = all.find(key); known != all.end()) return known->second;
  const auto& [free_command, job, free] = error_free(scene_case);
  if (scene_case.case_name == "error_free") return all[key] = to_json(sim::summary(job, free));
  sim::Cut cut = scene_case.case_name.empty()
                     ? sim::cut(job)
                     : sim::cut(job, sim::parse_case(scene_case.case_name));
  return all[key] = to_json(sim::summary(job, sim::judge(job, std::move(cut), &free)));
}

double machine_um(const SceneCase& scene_case) {
  return summary_of(scene_case)["machine_um"]["rms"];
}

const ordered_json& thermal_choice_of(const std::string& scene,
                                      const std::vector<sim::Override>& changes) {
  static std::map<std::string, ordered_json> all;
  const std::string key = command({scene, changes});
  if (const auto known = all.find(key); known != all.end()) return known->second;
  const sim::Scene own = scene_of(scene, changes);
  std::vector<sim::DayReadings> days{sim::measure_day("its own day", own)};
  for (const sim::Variant& variant : own.variants)
    days.push_back(sim::measure_day(variant.name, scene_of(scene, changes, variant.name)));
  return all[key] = sim::to_json(sim::choose_thermal_sensors(days, *own.sensor_choice));
}

const ordered_json& choice_of(const ordered_json& thermal, const std::string& name) {
  for (const ordered_json& choice : thermal["choices"])
    if (choice["name"] == name) return choice;
  throw std::invalid_argument("no choice " + name);
}

namespace {

/// Channels X, Y and Z of a choice, in this order.
std::vector<ordered_json> displacements(const ordered_json& choice) {
  std::vector<ordered_json> channels;
  for (const char* name : {"X", "Y", "Z"})
    for (const ordered_json& channel : choice["channels"])
      if (channel["name"] == name) channels.push_back(channel);
  return channels;
}

double missed(const ordered_json& channel) { return channel["cross_day"][0]["figures"]["rms"]; }

}  // namespace

std::string missed_on_its_day(const ordered_json& choice) {
  std::vector<std::string> words;
  for (const ordered_json& channel : displacements(choice))
    words.push_back(fmt::format("{:.2f}", channel["in_cycle"]["rms"].get<double>()));
  return joined(words, ", ");
}

std::string missed_on_another_day(const ordered_json& choice) {
  std::vector<std::string> words;
  for (const ordered_json& channel : displacements(choice))
    words.push_back(fmt::format("{:.1f}", missed(channel)));
  return joined(words, ", ") +
         fmt::format("; {:.1f} %", 100.0 * choice["rms_over_range"].get<double>());
}

std::string z_missed_on_another_day(const ordered_json& choice) {
  return fmt::format("{:.2f}", missed(displacements(choice).at(2)));
}

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  return fmt::format("{}", fmt::join(words, between));
}

}  // namespace abbe::figures
