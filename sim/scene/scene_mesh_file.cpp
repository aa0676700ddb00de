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
      .check([](TableReader& reader, MeshFile& mesh) {
        std::error_code failure;
        if (!mesh.file.empty() && !std::filesystem::is_regular_file(mesh.file, failure))
          reader.refuse("file", "a file that can be read", no_file(mesh.file));
      });
}

}  // namespace abbe::sim
