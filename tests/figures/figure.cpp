#include "tests/figures/figure.h"

#include <map>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/sampling.h"
#include "sim/loop/compensate.h"
#include "sim/report/sensor_choices_json.h"
#include "sim/report/summary_report.h"
#include "sim/scene/read_scene.h"

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
  const auto file = std::filesystem::path(ABBE_SOURCE_DIR) / "scenes" / (name + ".toml");
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

const ordered_json& summary_of(const SceneCase& one) {
  static std::map<std::string, ordered_json> all;
  const std::string key = command(one);
  if (const auto known = all.find(key); known != all.end()) return known->second;
  const sim::Job job = sim::prepare(scene_of(one.scene, one.set, one.variant));
  sim::Cut made =
      one.case_name.empty() ? sim::cut(job) : sim::cut(job, sim::parse_case(one.case_name));
  return all[key] = to_json(sim::summary(job, sim::judge(job, std::move(made), nullptr)));
}

const ordered_json& summary_as_run(const SceneCase& one) {
  static std::map<std::string, ordered_json> all;
  const std::string key = command(one);
  if (const auto known = all.find(key); known != all.end()) return known->second;
  const sim::Job job = sim::sampled(sim::prepare(scene_of(one.scene, one.set, one.variant)));
  const sim::Verdict error_free = sim::judge(job, sim::cut_error_free(job), nullptr);
  if (one.case_name == "error_free") return all[key] = to_json(sim::summary(job, error_free));
  sim::Cut made =
      one.case_name.empty() ? sim::cut(job) : sim::cut(job, sim::parse_case(one.case_name));
  return all[key] = to_json(sim::summary(job, sim::judge(job, std::move(made), &error_free)));
}

double machine_um(const SceneCase& one) {
  const sim::Job job = sim::prepare(scene_of(one.scene, one.set, one.variant));
  const sim::Verdict error_free = sim::judge(job, sim::cut_error_free(job), nullptr);
  sim::Cut made =
      one.case_name.empty() ? sim::cut(job) : sim::cut(job, sim::parse_case(one.case_name));
  return sim::judge(job, std::move(made), &error_free).machine->rms.value() / units::um;
}

const ordered_json& thermal_choice_of(const std::string& scene,
                                      const std::vector<sim::Override>& changes) {
  static std::map<std::string, ordered_json> all;
  const std::string key = command({scene, changes});
  if (const auto known = all.find(key); known != all.end()) return known->second;
  const sim::Scene own = scene_of(scene, changes);
  std::vector<sim::Day> days{sim::measured_day("its own day", own)};
  for (const sim::Variant& variant : own.variants)
    days.push_back(sim::measured_day(variant.name, scene_of(scene, changes, variant.name)));
  return all[key] = sim::to_json(sim::thermal_choice(days, *own.sensor_choice));
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
