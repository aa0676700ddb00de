#include <system_error>

#include "kinematics/units.h"
#include "sim/scene/nearest_word.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

Fields<MeshFile> mesh_file_fields(const KeyName& file) {
  return Fields<MeshFile>()
      .text(file, &MeshFile::file, "a mesh; faces of more than three corners are split")
      .word("unit", &MeshFile::unit,
            {{"mm", 1.0}, {"inch", units::inch}, {"cm", 10.0}, {"m", 1000.0}, {"um", units::um}},
            "of the numbers in the mesh")
      .boolean("any_size", &MeshFile::any_size,
               "of a mesh: its size is meant, however small or large; else one below 1 mm, or that "
               "does not fit the travel or the program, is doubted")
      .check([](TableReader& reader, MeshFile& mesh) {
        if (const Node* file = reader.node().find("file")) mesh.place = file->place;
        std::error_code failure;
        if (!mesh.file.empty() && !std::filesystem::is_regular_file(mesh.file, failure))
          reader.refuse("file", "a file that can be read", no_file(mesh.file));
      });
}

}  // namespace abbe::sim
