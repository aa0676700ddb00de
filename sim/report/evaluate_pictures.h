#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "errors/metrology/machine_tests.h"
#include "sim/files/output.h"
#include "sim/readings/part_readings_file.h"

namespace abbe::sim {

/// A picture of every test: positioning with its means and 2 s band, lines over their targets,
/// circles magnified over the nominal one, drift over time; none where the program was built
/// without VTK.
/// @param from  the file of the readings, named in every picture
/// @return their files @throws OutputFailure
std::vector<std::filesystem::path> write_test_pictures(const ResultFolder& folder,
                                                       const errors::metrology::Tests& tests,
                                                       const std::string& from);

/// `part.png`: how many points of a part have which deviation. @return its file, or none without
/// VTK
std::vector<std::filesystem::path> write_part_picture(const ResultFolder& folder,
                                                      const PartReadingsFile& part,
                                                      const std::string& from);

}  // namespace abbe::sim
