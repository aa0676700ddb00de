#include "sim/commands/render_command.h"

#include <memory>

#include "sim/files/terminal.h"
#include "sim/report/pictures.h"

namespace abbe::sim {

Command render_command(Common& common) {
  const auto words = std::make_shared<RenderOptions>();
  return {"render",
          "Draw a finished result again, or a difference of two",
          {{"RESULT", &words->result, "residual.vtp or a folder that has one"},
           {"--minus", &words->minus, "another result, taken away vertex by vertex"},
           {"--line", &words->line, "profile along x, y or radius instead of the map",
            OneOf{{"x", "y", "radius"}}},
           {"--out", &words->out, "folder for the pictures (that of RESULT)"},
           force_option(common),
           threads_option(common, "most threads to use")},
          [words, &common] {
            words->permissions = common.permissions;
            print("picture in {}\n", render_result(*words).string());
            return Exit::Ok;
          }};
}

}  // namespace abbe::sim
