#include "sim/commands/all_keys.h"

#include "sim/commands/exit_code.h"
#include "sim/report/key_rows.h"
#include "sim/scene/scene_fields.h"
#include "sim/study/study_fields.h"

namespace abbe::sim {

std::vector<Key> all_keys() {
  std::vector<Key> keys = scene_keys();
  Key study;
  study.name = "study";
  study.sentence = "a study, in a file of its own";
  study.kind = Key::Kind::Table;
  study.keys = study::study_keys();
  keys.push_back(std::move(study));
  return keys;
}

std::vector<Key> keys_of(const std::string& section) {
  std::vector<Key> keys = keys_at(all_keys(), section);
  if (keys.empty())
    throw BadUsage("--of", "expected scene, study or a section of them, seen " + section);
  return keys;
}

}  // namespace abbe::sim
