// Every folder of tests/golden with a program.nc is read in the dialect that its name begins with,
// for the gantry or the machine that machine.txt names, and listed; every file of
// tests/corpus/dialects is refused with the faults that expected.txt has for it. With
// ABBE_UPDATE_GOLDEN set the expectations are written instead; then read them.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <vector>

#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"

namespace abbe::sim::dialects {
namespace {

namespace fs = std::filesystem;
namespace machines = program::test;

const fs::path tests = fs::path(ABBE_SOURCE_DIR) / "tests";

bool updates() { return std::getenv("ABBE_UPDATE_GOLDEN") != nullptr; }

std::vector<fs::path> sorted(const fs::path& folder) {
  std::vector<fs::path> found;
  if (fs::exists(folder))
    for (const auto& entry : fs::directory_iterator(folder)) found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

Dialect dialect_of(const std::string& name) {
  for (const Dialect one :
       {Dialect::LinuxCnc, Dialect::Fanuc, Dialect::Siemens, Dialect::Heidenhain, Dialect::Cl})
    if (name.starts_with(std::string(name_of(one)) + "_")) return one;
  return Dialect::Auto;
}

machines::Chain machine_of(const fs::path& folder) {
  const std::string name = machines::file_text((folder / "machine.txt").string());
  if (name.starts_with("three_axis")) return machines::three_axis();
  if (name.starts_with("platform")) return machines::platform();
  if (name.starts_with("trunnion")) return machines::trunnion();
  return machines::gantry();
}

ReadOptions options_for(const fs::path& folder, const std::string& name) {
  ReadOptions options;
  options.control = machines::options_for(machine_of(folder));
  options.dialect = dialect_of(name);
  options.subprogram_folder = folder;
  return options;
}

TEST(DialectGolden, ProgramsMeanWhatTheirListingsSay) {
  int programs = 0;
  for (const fs::path& folder : sorted(tests / "golden")) {
    if (!fs::exists(folder / "program.nc")) continue;
    SCOPED_TRACE(folder.string());
    ++programs;
    const ReadOptions options = options_for(folder, folder.filename().string());
    std::string seen;
    try {
      const std::string text = machines::file_text((folder / "program.nc").string());
      const ParsedProgram read = read_program(text, "program.nc", options);
      seen = machines::listing(read.path, options.control);
      for (const std::string& warning : read.warnings) seen += "warning: " + warning + "\n";
    } catch (const BadInput& fault) {
      seen = std::string(fault.what()) + "\n";
    }
    if (updates()) std::ofstream(folder / "expected.txt") << seen;
    EXPECT_EQ(seen, machines::file_text((folder / "expected.txt").string()));
    EXPECT_EQ(seen.find(": expected "), std::string::npos) << "a golden program is read";
  }
  std::cout << programs << " programs\n";
}

TEST(DialectGolden, WhatIsWrongIsRefusedAllTogether) {
  const fs::path folder = tests / "corpus" / "dialects";
  std::string written;
  int files = 0;
  for (const fs::path& file : sorted(folder)) {
    const std::string name = file.filename().string();
    if (name == "expected.txt") continue;
    ++files;
    const ReadOptions options = options_for(folder, name);
    std::string seen = name + ": accepted";
    try {
      read_program(machines::file_text(file.string()), name, options);
      ADD_FAILURE() << seen;
    } catch (const BadInput& fault) {
      seen = fault.what();
    }
    written += seen + "\n";
  }
  if (updates()) std::ofstream(folder / "expected.txt") << written;
  EXPECT_EQ(written, machines::file_text((folder / "expected.txt").string()));
  std::cout << files << " files\n";
}

}  // namespace
}  // namespace abbe::sim::dialects
