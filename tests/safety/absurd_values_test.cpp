#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <nlohmann/json.hpp>
#include "sim/commands/calibration_commands.h"
#include "sim/cut/scene_checks.h"
#include "sim/loop/compensate.h"
#include "sim/report/check_report.h"
#include "sim/report/summary.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/table_reader.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

/// Every number of every shipped scene, one at a time, becomes absurd. The scene is then read, cut,
/// judged and measured in a process of its own with bounds of time and memory: it must succeed, or
/// be refused as an input fault that names the key or the line of the program that the value
/// spoils.
namespace abbe::safety {
namespace {

using sim::Node;
using sim::Override;

constexpr int max_wall_ms = 300'000;
constexpr ::rlim_t max_cpu_s = 40, most_bytes = ::rlim_t(6) << 30;

const std::vector<std::string> absurd{"0",   "-1",   "1e-300", "1e300",
                                      "1e9", "1e-9", "nan",    "\"NaN\""};

/// Dotted paths of the numbers of a tree; of a list of numbers the first and the last.
void collect(const Node& node, const std::string& path, std::vector<std::string>& keys) {
  const auto inner = [&](const std::string& key) { return path.empty() ? key : path + "." + key; };
  if (std::holds_alternative<double>(node.value) ||
      std::holds_alternative<std::int64_t>(node.value))
    keys.push_back(path);
  if (const Node::Table* table = node.table())
    for (const Node::Entry& entry : *table)
      if (entry.key != "variant") collect(entry.node, inner(entry.key), keys);
  if (const Node::Array* array = node.array())
    for (std::size_t i = 0; i < array->size(); ++i) {
      const bool number = !(*array)[i].table() && !(*array)[i].array();
      if (!number || i == 0 || i + 1 == array->size())
        collect((*array)[i], inner(std::to_string(i)), keys);
    }
}

/// What makes a shipped scene small, where it has the keys.
std::vector<Override> small(const Node& tree) {
  const auto has = [&](const char* section, const char* key) {
    const Node* one = tree.find(section);
    return one && one->find(key);
  };
  std::vector<Override> changes;
  const bool probed = tree.find("instrument") != nullptr;  // its points must be near what is cut
  if (!has("part", "file")) changes.push_back({"part.vertices", probed ? "3000" : "300"});
  const std::string* generator =
      has("program", "generator") ? tree.find("program")->find("generator")->text() : nullptr;
  if (generator && *generator == "raster") {
    for (const char* key : {"program.step_over_mm", "program.step_mm"})
      changes.push_back({key, probed ? "4.0" : "8.0"});
  }
  if (generator && *generator == "flank") changes.push_back({"program.step_mm", "4.0"});
  if (generator && *generator == "spiral") changes.push_back({"program.feed_um_per_rev", "400.0"});
  if (has("cutting", "spacing_mm")) changes.push_back({"cutting.spacing_mm", "2.0"});
  return changes;
}

std::vector<fs::path> scenes() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(source / "scenes"))
    if (entry.path().extension() == ".toml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// One trial: a scene, a key, a value.
struct Trial {
  fs::path scene;
  std::string key;
  std::string value;
};

/// A key without the numbers of lists: what is read by the same lines.
std::string kind_of(const std::string& key) {
  std::string kind, part;
  std::istringstream parts(key);
  while (std::getline(parts, part, '.'))
    if (part.find_first_not_of("0123456789") != std::string::npos) kind += "." + part;
  return kind;
}

/// All trials that differ in more than the place in a list or the scene of an equal section.
std::vector<Trial> trials() {
  std::vector<Trial> all;
  std::set<std::string> seen;
  for (const fs::path& file : scenes()) {
    const Node tree = sim::parse_toml(sim::read_scene(file).resolved, file.string());
    const Node* program = tree.find("program");
    const Node* generator = program ? program->find("generator") : nullptr;
    const Node* part = tree.find("part");
    const Node* surface = part ? part->find("surface") : nullptr;
    std::vector<std::string> keys;
    collect(tree, "", keys);
    for (const std::string& key : keys) {
      std::string same = kind_of(key);
      if (same.starts_with(".program") && generator && generator->text())
        same += *generator->text();
      if (same.starts_with(".part") && surface && surface->text()) same += *surface->text();
      if (same.starts_with(".instrument")) {
        const std::size_t index = std::size_t(std::atoi(key.substr(11).c_str()));
        if (const Node* list = tree.find("instrument");
            list->array() && index < list->array()->size())
          if (const Node* kind = (*list->array())[index].find("kind"); kind && kind->text())
            same += *kind->text();
      }
      if (!seen.insert(same).second) continue;
      for (const std::string& value : absurd) all.push_back({file, key, value});
    }
  }
  return all;
}

/// What a run does, without files and pictures.
void do_everything(const Trial& trial) {
  const Node tree = sim::parse_toml(sim::read_scene(trial.scene).resolved, "scene");
  std::vector<Override> changes = small(tree);
  changes.push_back({trial.key == "instrument_seed" ? "seed" : trial.key, trial.value});
  const sim::Scene scene = sim::read_scene(trial.scene, changes);
  if (trial.key.starts_with("instrument")) {
    for (const auto& one : scene.instruments) (void)sim::measure_machine(scene, one);
    for (const auto& one : scene.part_instruments) (void)sim::measure_cut_part(scene, one);
    return;
  }
  const sim::Job job = sim::prepare(scene);
  (void)sim::to_text(sim::describe(job));
  std::optional<sim::CaseDescription> compensator;
  const bool of_a_case = trial.key.starts_with("compensation") || trial.key.starts_with("belief");
  if (of_a_case && !scene.cases.empty()) compensator = scene.cases.front();
  const sim::Verdict verdict = sim::judge(job, sim::cut(job, compensator), nullptr);
  (void)to_json(sim::summary(job, verdict)).dump();
}

struct Ended {
  int code = 0;      ///< 0 done, 3 refused, 4 anything else that was thrown, 128 + n killed by n
  std::string text;  ///< of what was thrown
  double seconds = 0.0;  ///< of the processors
};

[[noreturn]] void child(const Trial& trial, int to) {
  const ::rlimit cpu{max_cpu_s, max_cpu_s}, space{most_bytes, most_bytes};
  ::setrlimit(RLIMIT_CPU, &cpu);
  ::setrlimit(RLIMIT_AS, &space);
  int code = 0;
  std::string text;
  try {
    do_everything(trial);
  } catch (const sim::BadScene& input_errors) {
    code = 3;
    text = input_errors.what();
  } catch (const BadInput& fault) {
    code = 3;
    text = fault.what();
  } catch (const std::exception& failure) {
    code = 4;
    text = failure.what();
  }
  (void)!::write(to, text.data(), std::min<std::size_t>(text.size(), 60000));
  ::_exit(code);
}

Ended ended(const Trial& trial) {
  int ends[2];
  if (::pipe(ends) != 0) return {4, "no pipe"};
  const ::pid_t pid = ::fork();
  if (pid == 0) child(trial, ends[1]);
  ::close(ends[1]);
  Ended result;
  char buffer[4096];
  ::pollfd said{ends[0], POLLIN, 0};
  while (::poll(&said, 1, max_wall_ms) > 0) {
    const ::ssize_t n = ::read(ends[0], buffer, sizeof buffer);
    if (n <= 0) break;
    result.text.append(buffer, std::size_t(n));
  }
  ::kill(pid, SIGKILL);  // nothing, if it has ended by itself
  ::close(ends[0]);
  int status = 0;
  ::rusage used{};
  ::wait4(pid, &status, 0, &used);
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  const auto seconds = [](const ::timeval& t) {
    return double(t.tv_sec) + 1e-6 * double(t.tv_usec);
  };
  result.seconds = seconds(used.ru_utime) + seconds(used.ru_stime);
  return result;
}

/// Places of a key and of what holds it, as refusals write them: "FILE:LINE:".
std::vector<std::string> places_of(const Trial& trial) {
  std::vector<std::string> places;
  const sim::Scene scene = sim::read_scene(trial.scene);
  const Node* node = scene.tree.get();
  std::istringstream parts(trial.key);
  for (std::string part; node && std::getline(parts, part, '.');) {
    const Node::Array* list = node->array();
    const std::size_t index = list ? std::size_t(std::atoi(part.c_str())) : 0;
    node = list ? (index < list->size() ? &(*list)[index] : nullptr) : node->find(part);
    if (node && node->position.file)
      places.push_back(*node->position.file + ":" + std::to_string(node->position.line) + ":");
  }
  return places;
}

/// Whether a refusal says where to look: a word of the key, its section, its place, or a line of
/// the program.
bool names(const std::string& text, const Trial& trial) {
  for (const char* place : {".ngc:", "program.csv:", ", from line "})
    if (text.find(place) != std::string::npos) return true;
  for (const std::string& place : places_of(trial))
    if (text.find(place) != std::string::npos) return true;
  std::istringstream parts(trial.key);
  std::string part;
  bool found = false;
  while (std::getline(parts, part, '.')) {
    const std::string stem(sim::key_without_unit(part));
    const bool word = part.find_first_not_of("0123456789") != std::string::npos;
    found = found || (word && text.find(stem) != std::string::npos);
  }
  return found;
}

std::string error_text(const Trial& trial, const Ended& end) {
  if (end.code == 0) return "";
  if (end.code == 3 && end.text.find("expected") != std::string::npos && names(end.text, trial))
    return "";
  return "scenes/" + trial.scene.filename().string() + " --set " + trial.key + "=" + trial.value +
         ": " + (end.code > 128 ? "ended by signal " + std::to_string(end.code - 128) : "") + " " +
         std::to_string(end.code) + " " + end.text.substr(0, 300);
}

TEST(AbsurdValues, OfEveryNumberOfEverySceneEndSoonAndSayWhichItWas) {
  const unsigned seed = 20261122;
  std::cout << "seed " << seed << "\n";
  std::vector<Trial> all = trials();
  ASSERT_GT(all.size(), 1000u);
  const bool exhaustive = std::getenv("ABBE_LONG") != nullptr;
  std::mt19937 random(seed);
  std::shuffle(all.begin(), all.end(), random);
  const double max_s = exhaustive ? 1e9 : 8.0;
  const auto start = std::chrono::steady_clock::now();
  std::size_t done = 0, refused = 0;
  double longest = 0.0;
  for (const Trial& trial : all) {
    const double spent =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (done >= 10 && spent > max_s) break;
    const Ended end = ended(trial);
    EXPECT_EQ(error_text(trial, end), "");
    ++done;
    refused += end.code == 3;
    longest = std::max(longest, end.seconds);
    if (exhaustive && done % 100 == 0) std::cout << done << " of " << all.size() << std::endl;
  }
  std::cout << done << " of " << all.size() << " trials, " << refused << " refused, longest "
            << longest << " s of the processors\n";
}

TEST(AbsurdValues, WithoutOneTheScenesAreDoneAsSmallAsTheyAreMade) {
  std::vector<fs::path> files = scenes();
  std::mt19937 random(20261122);
  std::shuffle(files.begin(), files.end(), random);
  if (std::getenv("ABBE_LONG") == nullptr) files.resize(6);
  for (const fs::path& file : files)
    for (const char* key : {"seed", "instrument_seed"}) {  // the latter measures
      const Ended end = ended({file, key, "1"});
      EXPECT_EQ(end.code, 0) << file << ": " << end.text;
    }
}

TEST(AbsurdValues, OfVerticesAreNamedWhereTheyTakeTheMemory) {
  const sim::Scene scene = sim::read_scene(source / "scenes/gantry_dome.toml");
  const auto said = [&](const sim::WorkEstimate& work) -> std::string {
    try {
      sim::check_work(scene, work);
    } catch (const BadInput& fault) {
      return fault.what();
    }
    return "";
  };
  sim::WorkEstimate work;
  work.limiting_keys = {"program.step_mm"};
  work.vertices = 5e7;
  work.points = 1e5;
  work.bytes = 1e15;
  EXPECT_HAS(said(work), "program.step_mm") << "the program takes it";
  work.vertices = 1e12;
  EXPECT_HAS(said(work), "part.vertices");
  EXPECT_EQ(said(work).find("program.step_mm"), std::string::npos) << said(work);
}

/// Faults that were found, each with what it must say.
TEST(AbsurdValues, ThatWereFoundAreRefusedAtTheirKey) {
  const struct {
    const char *scene, *key, *value, *says;
  } found[] = {
      {"gantry_dome", "program.step_over_mm", "0.001", "--set program.step_over_mm=0.001"},
      {"gantry_dome", "program.step_mm", "1e-9", "--set program.step_mm=1e-9"},
      {"gantry_dome", "errors.EXX.0.coefficients_um.1", "1e300", "coefficients_um"},
      {"gantry_dome", "errors.EXX.0.coefficients_um.1", "1e9", "EXX"},
      {"thermal_protocol", "instrument.0.interval_s", "1e6", "interval_s"},
      {"gantry_dome", "sampling.max_step_mm", "1e-6", "sampling.max_step_mm"},
      {"on_machine_measurement", "instrument.0.centre_mm.0", "1e9",
       "on_machine_measurement.toml:46:"},
  };
  for (const auto& one : found) {
    SCOPED_TRACE(std::string(one.scene) + " " + one.key + "=" + one.value);
    const Ended end =
        ended({source / "scenes" / (std::string(one.scene) + ".toml"), one.key, one.value});
    EXPECT_EQ(end.code, 3) << end.text;
    EXPECT_HAS(end.text, one.says);
    EXPECT_LT(end.seconds, 5.0);
  }
  // and what once never ended is done
  const Ended margin = ended({source / "scenes/gantry_mesh.toml", "part.judged_margin_mm", "1e-9"});
  EXPECT_EQ(margin.code, 0) << margin.text;
  EXPECT_LT(margin.seconds, 5.0);
}

}  // namespace
}  // namespace abbe::safety
