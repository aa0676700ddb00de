// Every folder of tests/golden with a program.ngc is read for the gantry and listed; every file of
// tests/corpus/nc and tests/corpus/pvt is refused with the message that expected.txt has for it.
// With ABBE_UPDATE_GOLDEN set the expectations are written instead; then read them.

#include "machines.h"
#include "sim/program/program_writers.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

using kinematics::AxisVector;

const fs::path tests = fs::path(ABBE_SOURCE_DIR) / "tests";

bool updates() { return std::getenv("ABBE_UPDATE_GOLDEN") != nullptr; }

/// A program that calls no G55 is read as where no offset is stated.
NcOptions gantry_options(const std::string& text) {
  NcOptions options = test::options_for(test::gantry());
  if (text.find("G55") == std::string::npos) return options;
  options.work_offset[1] = AxisVector::Zero(6);
  options.work_offset[1] << 10 * units::deg, 1, 2, 3, 0, 0;  // G55: C X Y Z A s
  return options;
}

std::vector<fs::path> sorted(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder)) found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

TEST(Golden, ProgramsMeanWhatTheirListingsSay) {
  int programs = 0;
  for (const fs::path& folder : sorted(tests / "golden")) {
    if (!fs::exists(folder / "program.ngc")) continue;
    SCOPED_TRACE(folder.string());
    ++programs;
    const NcOptions options = gantry_options(test::file_text((folder / "program.ngc").string()));
    std::string seen;
    ASSERT_NO_THROW(seen = test::listing(read_nc_file(folder / "program.ngc", options), options));
    if (updates()) std::ofstream(folder / "expected.txt") << seen;
    EXPECT_EQ(seen, test::file_text((folder / "expected.txt").string()));
  }
  std::cout << programs << " programs\n";
  EXPECT_GE(programs, 15);
}

void holds_corpus(const std::string& kind, int at_least) {
  const fs::path folder = tests / "corpus" / kind;
  std::map<std::string, std::string> expected;
  std::istringstream lines(test::file_text((folder / "expected.txt").string()));
  for (std::string line; std::getline(lines, line);)
    expected[line.substr(0, line.find(':'))] = line;
  std::string written;
  int files = 0;
  for (const fs::path& file : sorted(folder)) {
    if (file.filename() == "expected.txt") continue;
    SCOPED_TRACE(file.string());
    ++files;
    std::string seen = file.filename().string() + ": accepted";
    try {
      const std::string text = test::file_text(file.string()), name = file.filename().string();
      if (kind == "nc") {
        read_nc(text, name, gantry_options(text));
      } else {
        read_pvt(text, name, test::options_for(test::platform()));
      }
    } catch (const BadInput& refusal) {
      seen = refusal.what();
    }
    written += seen + "\n";
    if (!updates()) {
      EXPECT_EQ(seen, expected[file.filename().string()]);
    }
    EXPECT_EQ(seen.find("accepted"), std::string::npos);
  }
  if (updates()) std::ofstream(folder / "expected.txt") << written;
  std::cout << files << " files\n";
  EXPECT_GE(files, at_least);
}

TEST(Corpus, NcProgramsAreRefusedAtTheRightPlace) { holds_corpus("nc", 60); }
TEST(Corpus, PvtProgramsAreRefusedAtTheRightPlace) { holds_corpus("pvt", 15); }

}  // namespace
}  // namespace abbe::sim::program
