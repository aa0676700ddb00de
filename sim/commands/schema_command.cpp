#include "sim/commands/schema_command.h"

#include <memory>

#include <nlohmann/json.hpp>

#include "sim/commands/all_keys.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/schema.h"
#include "sim/scene/scene_fields.h"

namespace abbe::sim {
namespace {

Exit print_schema(const std::string& section) {
  const std::vector<Key> keys = section == "scene" ? scene_keys() : keys_of(section);
  print("{}", Lines(json_text(schema(keys, "abbe: " + section))));
  return Exit::Ok;
}

}  // namespace

Command schema_command() {
  const auto section = std::make_shared<std::string>("scene");
  return {"schema",
          "Print the JSON Schema of a scene or of a file for one of its sections, for editors",
          {"abbe schema", "abbe schema --of study"},
          {{"--of", section.get(),
            "scene, study, or a section that may be a file: machine, errors, tool, belief.force"}},
          [section] { return print_schema(*section); },
          "An editor that knows TOML (Taplo, Even Better TOML) completes keys and marks mistakes "
          "where the first line of a scene is  #:schema FILE"};
}

}  // namespace abbe::sim
