// The doctor's reading of the messages on a bus.
#include "tools/doctor/peers.h"

#include <gtest/gtest.h>

#include "hal/lcm/channels.h"

namespace ballast::doctor {
namespace {

using program::Finding;
constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

template <class M>
std::vector<char> bytes(const M& message) {
  std::vector<char> out(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(out.data(), 0, static_cast<int>(out.size()));
  return out;
}

template <class M>
void hear(Listener& listener, const char* channel, const M& message) {
  const auto data = bytes(message);
  listener.hear(channel, data.data(), data.size());
}

const Finding& about(const std::vector<Finding>& findings, const std::string& what) {
  for (const Finding& finding : findings) {
    if (finding.what == what) return finding;
  }
  ADD_FAILURE() << "nothing about " << what;
  return findings.front();
}

sensors_t sensors(std::int64_t scenario) {
  sensors_t m{};
  m.scenario_id = scenario;
  return m;
}

TEST(Peers, SilenceIsANoteWithAWayToBreakIt) {
  const auto findings = judge(Listener(), kUrl, hal::Seconds(1));
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings[0].verdict, Finding::Verdict::kNote);
  EXPECT_NE(findings[0].fix.find("ballast run"), std::string::npos);
}

TEST(Peers, LongListeningWaitsSecondBySecond) {
  using std::chrono::milliseconds;
  EXPECT_EQ(wait_ms(milliseconds(3'000'000'000)), 1000) << "more than an int of ms holds";
  EXPECT_EQ(wait_ms(milliseconds(500)), 500);
  EXPECT_EQ(wait_ms(milliseconds(-3)), 0);
}

TEST(Peers, OneScenarioWithDecodableMessagesIsFine) {
  Listener listener;
  for (int i = 0; i < 10; ++i) hear(listener, hal::kChannelSensors, sensors(7));
  const auto findings = judge(listener, kUrl, hal::Seconds(2));
  EXPECT_EQ(about(findings, hal::kChannelSensors).verdict, Finding::Verdict::kOk);
  EXPECT_NE(about(findings, hal::kChannelSensors).text.find("5 messages/s"), std::string::npos);
  EXPECT_NE(about(findings, "scenario").text.find("0000000000000007"), std::string::npos);
}

TEST(Peers, TwoScenariosOnOneBusFail) {
  Listener listener;
  hear(listener, hal::kChannelSensors, sensors(7));
  trip_t trip{};
  trip.scenario_id = 8;
  hear(listener, hal::kChannelTrip, trip);
  const Finding finding = about(judge(listener, kUrl, hal::Seconds(1)), "scenario");
  EXPECT_EQ(finding.verdict, Finding::Verdict::kFail);
  EXPECT_NE(finding.fix.find(":7668"), std::string::npos) << finding.fix;
}

TEST(Peers, TwoRunsOfOneScenarioOnOneBusFail) {
  Listener listener;
  for (const std::int64_t run : {11, 12, 0}) {  // 0: of no run, as peers that wait for one
    sensors_t message = sensors(7);
    message.run_id = run;
    hear(listener, hal::kChannelSensors, message);
  }
  const auto findings = judge(listener, kUrl, hal::Seconds(1));
  EXPECT_EQ(about(findings, "scenario").verdict, Finding::Verdict::kOk);
  EXPECT_EQ(about(findings, "runs").verdict, Finding::Verdict::kFail);
  EXPECT_NE(about(findings, "runs").text.find("2 on one bus"), std::string::npos) << about(findings, "runs").text;
  EXPECT_NE(about(findings, "runs").fix.find(":7668"), std::string::npos) << about(findings, "runs").fix;
}

TEST(Peers, AnotherBuildsFingerprintFails) {
  Listener listener;
  hear(listener, hal::kChannelContact, trip_t{});  // as far as the contact is concerned
  const Finding finding = about(judge(listener, kUrl, hal::Seconds(1)), hal::kChannelContact);
  EXPECT_EQ(finding.verdict, Finding::Verdict::kFail);
  char fingerprint[32];
  std::snprintf(fingerprint, sizeof fingerprint, "%llx",
                static_cast<unsigned long long>(static_cast<std::uint64_t>(trip_t::getHash())));
  EXPECT_NE(finding.text.find(fingerprint), std::string::npos) << finding.text;
}

TEST(Peers, WhatDoesNotDecodeFailsAndForeignChannelsAreNoted) {
  Listener listener;
  auto data = bytes(contact_t{});
  listener.hear(hal::kChannelContact, data.data(), data.size() - 1);
  listener.hear(hal::kChannelTrip, "", 0);
  contact_t nonsense{};
  nonsense.regime = 77;
  hear(listener, hal::kChannelContact, nonsense);
  listener.hear("GOSSIP", "x", 1);
  const auto findings = judge(listener, kUrl, hal::Seconds(1));
  EXPECT_EQ(about(findings, hal::kChannelContact).verdict, Finding::Verdict::kFail);
  EXPECT_NE(about(findings, hal::kChannelContact).text.find("2 of 2"), std::string::npos);
  EXPECT_EQ(about(findings, hal::kChannelTrip).verdict, Finding::Verdict::kFail);
  EXPECT_EQ(about(findings, "GOSSIP").verdict, Finding::Verdict::kNote);
}

}  // namespace
}  // namespace ballast::doctor
