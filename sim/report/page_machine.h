#pragma once

#include <string>
#include <vector>

#include "sim/report/page_data.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// Packs the bodies of the machine and of every tool, the motion along the program of the first
/// case's job, axes to 10 um and 0.01 degrees, spindles to a degree, and the tools called.
/// @return what is left out
std::vector<std::string> add_machine(PageData& data, const Job& job);

/// Packs what a case did along its program: where its track was kept, the deviation of the tool in
/// the part frame to within a fiftieth of the largest of the case or 50 nm; its signals from the
/// beginning of the program on and the clearance of every block to within 1/500 of what they span.
/// @param number  of the case in the index of the page
void add_course(PageData& data, const Compared& one, std::size_t number);

}  // namespace abbe::sim
