#pragma once

#include "kinematics/bad_input.h"

/// Input errors behind which a program is read otherwise than behind others.
namespace abbe::sim::program {

/// A limit of the program was reached: reading ends there.
struct Exhausted : BadInput {
  using BadInput::BadInput;
};

/// An input error that only follows from one that is reported already: it is left out.
struct FollowingError : BadInput {
  using BadInput::BadInput;
};

}  // namespace abbe::sim::program
