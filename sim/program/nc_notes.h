#pragma once

#include "sim/program/nc_block.h"
#include "sim/program/nc_codes.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// What a program says beside its motion, noted in its path block by block as it is read.
class NcNotes {
 public:
  /// @param path  outlives it
  explicit NcNotes(Path& path) : path_(path) {}

  /// Comments that give the diameter of a tool. What they leave unsaid of its unit is that of the
  /// program, from the next word of unit if there was none before.
  void note_comments(const NcBlock& block);
  /// T M6 M7 M8, G20 G21.
  void note_before_motion(const NcBlock& block, const Codes& codes);
  /// What a control does after the motion of the block: M0 M1 M9.
  void note_after_motion(const Codes& codes);

 private:
  void note_tool(const NcBlock& block, const Codes& codes);
  void note_unit(const NcBlock& block, const Codes& codes);

  Path& path_;
  int tool_ = -1;  ///< of the last T word
};

}  // namespace abbe::sim::program
