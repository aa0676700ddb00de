#pragma once

#include "render/machine.h"
#include "sim/cut/cut.h"
#include "sim/cut/program_alone.h"

namespace abbe::sim {

/// Machine, part and path as `abbe check --picture` draws them: the axes as they stand half way
/// through the program, the blocks of its description, or where that has none carriages as plain
/// bodies stacked from the tool and from the part to the bed, which stands below all of it, the
/// path, or stretches of a long one, where it should run and where it runs, errors magnified.
render::MachinePicture machine_picture(const Job& job);

/// Machine and path of a program alone: moves at feed and rapids, the axes as they stand at its
/// end.
render::MachinePicture machine_picture(const ProgramAlone& alone);

}  // namespace abbe::sim
