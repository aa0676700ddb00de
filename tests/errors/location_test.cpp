#include "errors/element.h"
#include "tests/errors/location_net.h"
#include "tests/errors/machines.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

Chain with_options(const Chain& chain, kinematics::Squareness squareness,
                   kinematics::DeviationAxes axes) {
  std::vector<Joint> joints = chain.joints();
  for (Joint& joint : joints) {
    joint.squareness = squareness;
    joint.deviation_axes = axes;
  }
  return Chain(joints, chain.T_bw_home(), chain.T_bt_home());
}

// The machines are twice those of `net::random_machines`: with the frames that the structural code
// asks for, and with directions of travel alone.
TEST(Location, EveryElementIsTheAngleOrTheLineThatItIsByDefinitionOnAnyStructuralCode) {
  SeededRandom random(20261122);
  net::Misses misses;
  std::map<std::string, int> elements;
  for (int i = 0; i < net::random_machines(); ++i) {
    const Chain chain = net::random_machine(random);
    for (const auto& name : net::location_elements(chain)) ++elements[name];
    net::expect_location_elements(chain, misses);
    if (testing::Test::HasFailure()) break;
  }
  net::print("frames", misses);
  for (const auto& [name, count] : elements) std::cout << " " << name << " " << count;
  std::cout << "\n";
  EXPECT_EQ(elements.size(), 3u + 12u + 6u + 4u);
}

TEST(Location, AnglesOfTravelAloneAreTheSameAnglesOnAnyStructuralCode) {
  SeededRandom random(20261123);
  net::Misses misses;
  for (int i = 0; i < net::random_machines(); ++i) {
    const Chain chain = with_options(net::random_machine(random), kinematics::Squareness::Travel,
                                     kinematics::DeviationAxes::Fixed);
    for (const std::string& text : net::location_elements(chain)) {
      const net::Alone one = net::alone(chain, text);
      net::expect_slides(one, misses);
      if (one.axis().motion == Motion::Rotary) net::expect_own_direction(one, misses);
    }
    if (testing::Test::HasFailure()) break;
  }
  net::print("travel", misses);
}

TEST(ErrorMotions, AreTheMotionsOfTheCarriageThatTheirNamesSayOnAnyStructuralCode) {
  SeededRandom random(20261124);
  net::Misses misses;
  for (int i = 0; i < net::random_machines(); ++i) {
    const auto axes = i % 2 ? kinematics::DeviationAxes::Turning : kinematics::DeviationAxes::Fixed;
    net::expect_error_motions(
        with_options(net::random_machine(random), kinematics::Squareness::Frame, axes), misses);
    if (testing::Test::HasFailure()) break;
  }
  net::print("error motions", misses);
}

// Slides up to 6 degrees off the bed's axes: a squareness turns one of its two against the other
// about the bed axis of its letter, whatever that makes of the angle between them; the other angles
// change by no more than the spread times the element.
TEST(Location, ASquarenessOfObliqueSlidesTurnsOneAboutTheBedAxisOfItsLetter) {
  SeededRandom random(20261125);
  const double spread = 0.1, e = net::angle_given;
  double own = 0.0, other = 0.0;
  for (int i = 0; i < net::random_machines(); ++i) {
    const Chain chain = net::random_machine(random, spread);
    const std::map<int, int> slides = net::slides_of(chain);
    for (const std::string text : {"EC0Y", "EB0Z", "EA0Z"}) {
      const net::Alone one = net::alone(chain, text);
      const int earlier = slides.at(text[1] == 'A' ? 1 : 0);
      const auto u = [&](int j) { return chain.joints()[std::size_t(j)].direction_b; };
      for (const auto& [a, first] : slides)
        for (const auto& [b, second] : slides) {
          if (a >= b) continue;
          const bool is_own = (first == one.joint || second == one.joint) &&
                              (first == earlier || second == earlier);
          const double seen = net::opened(one, first, second);
          const Vector3d leaning = kinematics::rotation(one.unit() * e) * u(one.joint);
          const double expected =
              oracles::angle(leaning, u(earlier)) - oracles::angle(u(one.joint), u(earlier));
          if (is_own) own = std::max(own, std::abs(seen - expected));
          if (!is_own) other = std::max(other, std::abs(seen));
        }
    }
  }
  std::cout << "own " << own << " rad off, other angles up to " << other << " of " << e << "\n";
  EXPECT_LT(own, 1e-14);
  EXPECT_LT(other, 3.0 * spread * e);
  EXPECT_GT(other, 0.0);
}

std::string refusal_alone(const std::string& element, const Chain& chain) {
  return thrown_text<std::invalid_argument>([&] { net::alone(chain, element); });
}

TEST(Location, WhatIsNoAngleOfTheMachineIsRefusedWithItsReason) {
  EXPECT_EQ(refusal_alone("EC0X", gantry()),
            "EC0X: X is the reference of Y; state the angle between them as EC0Y, which has the "
            "opposite sign");
  EXPECT_EQ(refusal_alone("EA0Y", gantry()),
            "EA0Y: Y is the reference of Z; state the angle between them as EA0Z, which has the "
            "opposite sign");
  EXPECT_EQ(refusal_alone("EB0X", platform()),
            "EB0X: X is the reference of Z; state the angle between them as EB0Z, which has the "
            "opposite sign");
  EXPECT_EQ(refusal_alone("EC0X", platform()),
            "EC0X: no other slide of this machine travels perpendicular to Z, so X has no "
            "squareness; state its angle to a rotary axis as an element of the rotary axis");
  EXPECT_HAS(refusal_alone("EA0Z", platform()),
             "no other slide of this machine travels perpendicular to X");
  EXPECT_HAS(refusal_alone("EC0Y", platform()), "expected an axis of the machine");
}

TEST(Location, IsSaidInWords) {
  const auto said = [](const char* element, const Chain& chain) {
    const ElementName name = parse_element_name(element);
    return meaning(name, chain, axis_joint(name.axis, chain, element));
  };
  EXPECT_EQ(said("EC0Y", gantry()), "squareness of Y to X");
  EXPECT_EQ(said("EA0Z", gantry()), "squareness of Z to Y");
  EXPECT_EQ(said("EC0A", gantry()), "parallelism of A to X about Z");
  EXPECT_EQ(said("EA0C", gantry()), "squareness of C to Y");
  EXPECT_EQ(said("EX0C", gantry()), "offset of C along X");
  EXPECT_EQ(said("EC0S", platform()), "parallelism of S to X about Z");
}

}  // namespace
}  // namespace abbe::errors
