// No mistake of a user gives another result in silence (mistakes/mistake.h).

#include "sim/commands/calibration_commands.h"
#include "sim/cut/collisions.h"
#include "sim/cut/placement.h"
#include "sim/loop/compensate.h"
#include "sim/report/summary.h"
#include "sim/scene/read_scene.h"
#include "sim/study/configuration.h"
#include "sim/study/study.h"
#include "tests/safety/mistakes/mistake.h"
#include "tests/test.h"

namespace abbe::safety {
namespace {

struct Table {
  std::string input;
  std::vector<Mistake> (*rows)();
};

const std::vector<Table> tables{{"bodies", mistakes_in_bodies},
                                {"compensators", mistakes_in_compensators},
                                {"errors", mistakes_in_errors},
                                {"forces", mistakes_in_forces},
                                {"heat", mistakes_in_heat},
                                {"instruments", mistakes_in_instruments},
                                {"machines", mistakes_in_machines},
                                {"meshes", mistakes_in_meshes},
                                {"programs", mistakes_in_programs},
                                {"readings", mistakes_in_readings},
                                {"scenes", mistakes_in_scenes},
                                {"studies", mistakes_in_studies},
                                {"temperatures", mistakes_in_temperatures},
                                {"tools", mistakes_in_tools}};

Files with(Files files, const std::vector<Edit>& edits) {
  for (const Edit& edit : edits) files[edit.file] = edit.change(files[edit.file]);
  return files;
}

struct Said {
  std::string input_error;
  std::vector<std::string> warnings;
};

std::vector<std::string> warnings_of_run(const fs::path& scene, bool is_compensated) {
  sim::Job job = sim::check_placement(sim::prepare(sim::read_scene(scene)));
  if (std::string text = sim::proximity_warning(job); !text.empty())
    job.warnings.push_back(std::move(text));
  sim::Cut cut = is_compensated ? sim::cut(job, job.scene.cases.at(0)) : sim::cut(job);
  sim::check_cuts_part(job, cut);
  const sim::Verdict verdict = sim::judge(job, std::move(cut), nullptr);
  std::vector<std::string> warnings = sim::summary(job, verdict).warnings;
  for (std::string& text : sim::exceeded_limits(job.scene.limits, verdict))
    warnings.push_back(std::move(text));
  return warnings;
}

std::vector<std::string> warnings_of_measuring(const Folder& folder) {
  std::vector<std::string> warnings;
  for (const sim::MeasuredFile& file :
       sim::measure(folder / "scene.toml",
                    {.overrides = {}, .instruments = {}, .folder = folder / "readings"}))
    warnings.insert(warnings.end(), file.warnings.begin(), file.warnings.end());
  return warnings;
}

std::vector<std::string> warnings_of_study(const fs::path& file) {
  const sim::study::Study study = sim::study::load_scene(sim::study::read_study(file));
  return sim::study::prepare_configuration(study, study.configurations.front(), {}).job.warnings;
}

std::vector<std::string> warnings_of_identifying(const Folder& folder, const Files& files,
                                                 const sim::IdentificationOptions& options) {
  std::vector<fs::path> readings;
  for (const auto& [name, text] : files)
    if (name.ends_with(".csv")) readings.push_back(folder / name);
  return sim::identified(readings, options).warnings;
}

/// What is said by the command that reads the files; a result follows, but no picture.
Said said_of(const Files& files, Command command, const sim::IdentificationOptions& options) {
  const Folder folder;
  for (const auto& [name, text] : files) folder.write(name, text);
  try {
    switch (command) {
      case Command::Run:
      case Command::RunCase:
        return {"", warnings_of_run(folder / "scene.toml", command == Command::RunCase)};
      case Command::Measure:
        return {"", warnings_of_measuring(folder)};
      case Command::Study:
        return {"", warnings_of_study(folder / "study.toml")};
      case Command::Identify:
        return {"", warnings_of_identifying(folder, files, options)};
    }
  } catch (const sim::BadScene& fault) {
    return {fault.what(), {}};
  } catch (const BadInput& fault) {
    return {fault.what(), {}};
  }
  return {};
}

Said said_of(const Mistake& row) {
  const Base& base = bases().at(row.base);
  sim::IdentificationOptions options;
  for (const OptionsChange& change : {base.options, row.options})
    if (change) change(options);
  return said_of(with(base.files(), row.edits), row.command.value_or(base.command), options);
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += "\n  " + line;
  return text.empty() ? " nothing" : text;
}

TEST(UserMistakes, OfARightInputNothingIsSaid) {
  for (const auto& [name, base] : bases()) {
    const Said said = said_of({name, name, {}, Expected::Warning, ""});
    EXPECT_EQ(said.input_error, "") << name;
    EXPECT_TRUE(said.warnings.empty()) << name << joined(said.warnings);
  }
}

TEST(UserMistakes, HundredAreOfOurOwn) {
  std::set<std::string> names;
  std::size_t own = 0;
  for (const Table& table : tables) {
    const std::vector<Mistake> rows = table.rows();
    std::size_t own_rows = 0;
    for (const Mistake& row : rows) {
      own_rows += !row.is_reported;
      EXPECT_TRUE(names.insert(row.name).second) << "two rows are named " << row.name;
      EXPECT_NE(row.says, "") << row.name;
    }
    std::cout << fmt::format("{:14}{:4} mistakes, {:3} of our own\n", table.input, rows.size(),
                             own_rows);
    EXPECT_GE(own_rows, 6u) << table.input;
    own += own_rows;
  }
  std::cout << fmt::format("{:14}{:4} mistakes, {:3} of our own\n", "all", names.size(), own);
  EXPECT_GE(own, 100u);
}

class MistakesIn : public testing::TestWithParam<Table> {};

TEST_P(MistakesIn, EachIsSaid) {
  for (const Mistake& row : GetParam().rows()) {
    SCOPED_TRACE(row.base + ": " + row.name);
    const Said said = said_of(row);
    const bool is_error = row.expected == Expected::InputError;
    EXPECT_EQ(!said.input_error.empty(), is_error) << said.input_error << joined(said.warnings);
    const std::string text = is_error ? said.input_error : joined(said.warnings);
    EXPECT_HAS(text, row.says);
  }
}

INSTANTIATE_TEST_SUITE_P(Inputs, MistakesIn, testing::ValuesIn(tables),
                         [](const auto& row) { return row.param.input; });

// What a method of `identify` does not use would be without effect.
TEST(UserMistakes, AnOptionThatAMethodIgnoresIsAUsageError) {
  const Folder folder;
  for (const auto& [name, text] : readings_files()) folder.write(name, text);
  const std::string identify = "identify laser.csv square.csv --out belief.toml ";
  const std::string here = "cd " + folder.path().string() + " &&";
  for (const char* option :
       {"--sensors S1", "--sensor-count 3", "--margin 0.2", "--margin 10",
        "--method thermal --order 7", "--method thermal --pitch X=12",
        "--method thermal --choose-orders", "--method step_diagonal --outliers 5"}) {
    const Ran ran = run(identify + option, here);
    EXPECT_EQ(ran.code, 2) << option << "\n" << ran.text;
    EXPECT_FALSE(fs::exists(folder / "belief.toml")) << option;
  }
}

}  // namespace
}  // namespace abbe::safety
