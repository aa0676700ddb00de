#pragma once

#include "render/machine_picture.h"
#include "sim/cut/cut.h"
#include "sim/cut/program_inspection.h"

namespace abbe::sim {

/// Machine, fixtures, part and path as `abbe check --picture` draws them: the axes as they stand
/// half way through the program, the blocks of its description, or where that has none carriages as
/// plain bodies stacked from the tool and from the part to the bed, which stands below all of it,
/// the path, or stretches of a long one, where it should run and where it runs, errors magnified.
render::MachinePicture machine_picture(const Job& job);

/// Machine and path of a program alone: moves at feed and rapids, the axes as they stand at its
/// end.
render::MachinePicture machine_picture(const ProgramInspection& alone);

/// A round factor that makes the largest error of a path, mm, about a twentieth of the part; 1
/// where it is large enough or zero.
double round_magnification(double part_size, double largest_error);

/// A plain body in the frame of what carries it, `Carriers::carriage` or the bed, axes at zero.
struct SchematicBody {
  render::Body body;
  int frame = 0;
};

/// Carriages, spindle and bed of a machine whose description gives it no shape, as the picture
/// above has them, without what joins them: that would stretch.
std::vector<SchematicBody> schematic_bodies(const Job& job);

}  // namespace abbe::sim
