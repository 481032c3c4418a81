// C++ wrapper: loans, moves, groups and exceptions. Usage: round_trip_cpp TABLE, with channels ping and pong of SkinFrame.
#undef NDEBUG
#include <cassert>
#include <cstring>
#include <thread>

#include <tactnet/channel.hpp>

using namespace std::chrono_literals;

int main(int argc, char **argv) {
  assert(argc == 2);
  try {
    tactnet::bus("nowhere.toml");
    assert(false);
  } catch (const tactnet::error &error) {
    assert(error.outcome() == TACTNET_OUTCOME_TABLE && std::strstr(error.what(), "nowhere.toml"));
  }
  tactnet::bus bus(argv[1]);
  try {
    (void)bus.get_port<tactnet_tactile_belief>("ping");
    assert(false);
  } catch (const tactnet::error &error) {
    assert(error.outcome() == TACTNET_OUTCOME_TYPE);
  }
  auto in = bus.get_port<tactnet_skin_frame>("ping");
  auto back = bus.get_port<tactnet_skin_frame>("pong");
  auto also = bus.get_port<tactnet_skin_frame>("ping");
  auto group = bus.sync_group(back, also);
  auto out = bus.put_port<tactnet_skin_frame>("ping", TACTNET_PRIORITY_HIGH);
  assert(!in.get(1ms) && !in.try_get() && !group.wait(1ms));
  {
    auto unsent = out.loan();
    auto moved = std::move(unsent);
    moved->taxels = 1;
  }
  auto pong = bus.put_port<tactnet_skin_frame>("pong");
  std::thread answers([&pong, &in] {
    auto question = in.get();
    tactnet_skin_frame answer{};
    answer.sequence = question->begin()->sequence + 1;
    pong.put(answer);
  });
  auto frame = out.loan();
  frame->sequence = 41;
  out.put(std::move(frame));
  assert(frame.begin() == nullptr);
  while (group.wait(10s) != std::size_t{0}) assert(also.try_get()->begin()->sequence == 41);
  auto answer = back.get(1s);
  assert(answer && answer->size() == 1 && (*answer)[0].sequence == 42 && answer->sequence() == 0 && !answer->remote());
  answer.reset();
  answers.join();
  assert(back.lost() == 0);

  // A channel that is created at run time, with a getter that is too slow.
  tactnet_channel_resources resources{};
  resources.depth = 2;
  bus.create_channel<tactnet_skin_frame>("own/frames", resources);
  auto slow = bus.get_port<tactnet_skin_frame>("own/frames");
  slow.set_priority(TACTNET_PRIORITY_HIGH);
  auto own = bus.put_port<tactnet_skin_frame>("own/frames");
  assert(own.losses().empty());
  for (int i = 0; i < 5; i++) own.put(tactnet_skin_frame{});
  const auto losses = own.losses();
  assert(losses.size() == 1 && losses[0].getter == slow.number());
  assert(losses[0].packets == 3 && slow.lost() == 3);
}
