// A run tells its scenario on the bus, and who listens puts the pieces together.
#include "tools/recording/scenario_beacon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "hal/lcm/bus.h"
#include "tests/conformance/test_bus.h"
#include "tests/random_seed.h"

namespace ballast::sil::test {
namespace {

std::vector<scenario_piece_t> pieces_of(const std::string& text, std::int64_t run_id) {
  std::vector<scenario_piece_t> pieces;
  for (std::size_t from = 0; from < text.size(); from += scenario_piece_t::MOST_SIZE) {
    scenario_piece_t piece{};
    const std::size_t size = std::min<std::size_t>(scenario_piece_t::MOST_SIZE, text.size() - from);
    std::copy_n(text.data() + from, size, piece.text);
    piece.run_id = run_id;
    piece.piece = static_cast<std::int32_t>(pieces.size());
    piece.size = static_cast<std::int16_t>(size);
    pieces.push_back(piece);
  }
  for (scenario_piece_t& piece : pieces) piece.pieces = static_cast<std::int32_t>(pieces.size());
  return pieces;
}

TEST(ScenarioPieces, AnyOrderRepeatedAndAfterAnotherRun) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  for (int round = 0; round < 50; ++round) {
    std::string text(1 + random() % 20000, ' ');
    for (char& letter : text) letter = static_cast<char>(random());
    std::vector<scenario_piece_t> pieces = pieces_of(text, 7);
    ScenarioPieces together;
    std::vector<scenario_piece_t> others = pieces_of(std::string(5000, 'x'), 8);
    others.pop_back();
    for (const auto& other : others) EXPECT_EQ(together.take(other), "");
    std::shuffle(pieces.begin(), pieces.end(), random);
    for (std::size_t k = 0; k + 1 < pieces.size(); ++k) {
      EXPECT_EQ(together.take(pieces[k]), "");
      EXPECT_EQ(together.take(pieces[k]), "");
    }
    EXPECT_EQ(together.take(pieces.back()), text);
    EXPECT_EQ(together.take(pieces.front()), text);
  }
}

TEST(ScenarioPieces, OutOfRangeIsRefused) {
  const scenario_piece_t good = pieces_of("a", 7).front();
  EXPECT_TRUE(in_range(good));
  const auto refused = [&](auto change) {
    scenario_piece_t piece = good;
    change(piece);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(piece.getEncodedSize()));
    piece.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    scenario_piece_t out{};
    EXPECT_FALSE(hal::decode(bytes.data(), bytes.size(), out));
  };
  refused([](scenario_piece_t& p) { p.pieces = 0; });
  refused([](scenario_piece_t& p) { p.pieces = scenario_piece_t::MOST_PIECES + 1; });
  refused([](scenario_piece_t& p) { p.piece = -1; });
  refused([](scenario_piece_t& p) { p.piece = p.pieces; });
  refused([](scenario_piece_t& p) { p.size = 0; });
  refused([](scenario_piece_t& p) { p.size = scenario_piece_t::MOST_SIZE + 1; });
}

TEST(ScenarioBeacon, WhoComesLateGetsTheSameScenario) {
  const sim::ScenarioResult written =
      sim::read_scenario(BALLAST_SCENARIO_DIR "/desk_ball.toml", {"duration=3", "surface.static_friction=0.4"});
  ASSERT_TRUE(written.ok());
  const std::string url = hal::test::test_bus_url();
  hal::Bus bus(url);
  ASSERT_TRUE(bus.good());
  const ScenarioBeacon beacon(url, 7, written.scenario);
  ScenarioPieces together;
  std::string text;
  int times = 0;
  bus.subscribe<scenario_piece_t>(hal::kChannelScenario, [&](const scenario_piece_t& piece) {
    EXPECT_EQ(piece.run_id, 7);
    EXPECT_EQ(piece.scenario_id, written.scenario.id);
    text = together.take(piece);
    if (piece.piece == piece.pieces - 1) ++times;
  });
  // The first time may pass before this bus hears. Twice: it is told again and again.
  const auto enough = [&] { return times >= 2; };
  ASSERT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(30)), enough), hal::Status::kOk);
  const sim::ScenarioResult heard = sim::parse_scenario(text, "the bus");
  ASSERT_TRUE(heard.ok()) << to_string(heard.errors.front());
  EXPECT_EQ(heard.scenario.id, written.scenario.id);
}

}  // namespace
}  // namespace ballast::sil::test
