// Pages kept on a node: whatever lies in the stage, and whatever fails there, pages are right.
#include "storage/page_stage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "io/fault_injector.h"
#include "io/page_file_damage.h"
#include "io/page_file_fixture.h"

namespace surfeit {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::uint32_t kNodePages = 20, kSurfelPages = 60, kPages = kNodePages + kSurfelPages;
constexpr std::uint64_t kChunk = 4096;

class PageStageTest : public PageFileTest {
 protected:
  void SetUp() override {
    PageFileTest::SetUp();
    std::filesystem::create_directory(path("scenes"));
    writePages("b.sft", kNodePages, kSurfelPages, kFileIdentity + 1);
    std::filesystem::rename(path("b.sft"), path("scenes/b.sft"));
    writePages("a.sft", kNodePages, kSurfelPages);
    std::filesystem::create_directory(path("node"));
  }

  PageFile open(const std::string& name = "a.sft", std::uint64_t limit = 0) {
    Result<PageFile> pages = PageFile::open(path(name));
    EXPECT_TRUE(pages.ok()) << pages.status().message();
    pages->setStage(std::make_shared<PageStage>(
        PageStage::Options{path("node"), limit, kChunk},
        PageStage::Scene{pages->identity(), pages->directoryChecksum(), pages->fileBytes()}));
    stored_bytes_ = 0;
    for (std::uint32_t page = 0; page < kPages; ++page) {
      stored_bytes_ += pages->entry(page).stored_bytes;
    }
    return std::move(*pages);
  }
  void expectPages(const PageFile& pages) {
    AlignedBuffer stored;
    std::vector<std::byte> payload;
    for (std::uint32_t i = 0; i < kPages; ++i) {
      const Status status = pages.readPage(i, stored, payload);
      ASSERT_TRUE(status.ok()) << status.message();
      ASSERT_EQ(payload, payloadOf(i < kNodePages ? i : 100 + i - kNodePages)) << i;
    }
  }
  std::string stagePath() { return open().stage()->path(); }

  std::uint64_t stored_bytes_ = 0;  // of all pages
};

TEST_F(PageStageTest, WhatWasReadIsReadThere) {
  const PageFile first = open();
  expectPages(first);
  // Whole chunks, once each
  ASSERT_GT(stored_bytes_, 2 * kChunk);
  EXPECT_GE(first.stage()->bytesKept(), stored_bytes_);
  EXPECT_LE(first.stage()->bytesKept(), std::min(stored_bytes_ + 2 * kChunk, first.fileBytes()));
  EXPECT_LT(first.stage()->bytesRead(), stored_bytes_);
  const PageFile second = open();
  // Of the scene nothing is read
  struct ::stat scene {};
  ASSERT_EQ(::stat(path("a.sft").c_str(), &scene), 0);
  CountCalls reads([&](const CallInfo& info) {
    struct ::stat read {};
    return info.call == Call::kPread && ::fstat(info.descriptor, &read) == 0 &&
           read.st_ino == scene.st_ino;
  });
  {
    const Faults faults{&reads};
    expectPages(second);
  }
  EXPECT_EQ(reads.count(), 0);
  EXPECT_EQ(second.stage()->bytesRead(), stored_bytes_);
  EXPECT_EQ(second.stage()->bytesKept(), 0u);
  EXPECT_THAT(second.stage()->takeNotes(), IsEmpty());
}

TEST_F(PageStageTest, TasksShareIt) {
  std::vector<PageFile> tasks;
  for (int i = 0; i < 4; ++i) tasks.push_back(open());
  std::vector<std::thread> threads;
  for (const PageFile& task : tasks) threads.emplace_back([&] { expectPages(task); });
  for (std::thread& thread : threads) thread.join();
  for (const PageFile& task : tasks) {
    EXPECT_THAT(task.stage()->takeNotes(), IsEmpty());
    EXPECT_GT(task.stage()->bytesRead(), 0u);
  }
}

TEST_F(PageStageTest, ScenesAreToldApart) {
  expectPages(open());
  const PageFile other = open("scenes/b.sft");
  EXPECT_NE(other.stage()->path(), stagePath());
  expectPages(other);
  EXPECT_GE(other.stage()->bytesKept(), stored_bytes_);
}

TEST_F(PageStageTest, DamageIsToldOnceAndMended) {
  expectPages(open());
  const std::string name = "node/" + std::filesystem::path(stagePath()).filename().string();
  const std::string good = contents(name);
  for (std::size_t at = kFileHeaderBytes; at < kFileHeaderBytes + stored_bytes_; at += 7) {
    std::string bad = good;
    bad[at] ^= 0x10;
    write(name, bad);
    const PageFile pages = open();
    expectPages(pages);
    EXPECT_GT(pages.stage()->bytesKept(), 0u);
    const std::vector<std::string> notes = pages.stage()->takeNotes();
    ASSERT_THAT(notes, SizeIs(1));
    EXPECT_THAT(notes[0], HasSubstr(": damaged at "));
    EXPECT_EQ(contents(name), good);
  }
  // All of it
  write(name, std::string(good.size(), 'x'));
  const PageFile pages = open();
  expectPages(pages);
  EXPECT_THAT(pages.stage()->takeNotes(), SizeIs(1));
  // Cut, as by a task that was killed: nothing was there
  write(name, good.substr(0, 2 * kChunk));
  const PageFile cut = open();
  expectPages(cut);
  EXPECT_GT(cut.stage()->bytesRead(), stored_bytes_ / 3);
  EXPECT_GT(cut.stage()->bytesKept(), stored_bytes_ / 3);
  EXPECT_LT(cut.stage()->bytesKept(), stored_bytes_);
}

TEST_F(PageStageTest, FullDisksAreToldOnce) {
  const PageFile pages = open();
  FullDisk full(kChunk + 100);
  {
    const Faults faults{&full};
    expectPages(pages);
  }
  const std::vector<std::string> notes = pages.stage()->takeNotes();
  ASSERT_THAT(notes, SizeIs(1));
  EXPECT_THAT(notes[0], HasSubstr("No space left"));
  EXPECT_THAT(notes[0], HasSubstr("no more pages are kept there"));
  EXPECT_EQ(pages.stage()->bytesKept(), kChunk);
  // What is there serves
  const PageFile again = open();
  expectPages(again);
  EXPECT_GT(again.stage()->bytesRead(), kChunk / 2);
}

TEST_F(PageStageTest, LimitsAreKept) {
  const std::uint64_t limit = 2 * kChunk;
  const PageFile pages = open("a.sft", limit);
  expectPages(pages);
  ASSERT_GT(stored_bytes_, limit);
  struct ::stat info {};
  ASSERT_EQ(::stat(pages.stage()->path().c_str(), &info), 0);
  EXPECT_LE(std::uint64_t(info.st_blocks) * 512, limit);
  EXPECT_GT(pages.stage()->bytesKept(), 0u);
  EXPECT_LT(pages.stage()->bytesKept(), stored_bytes_);
  const std::vector<std::string> notes = pages.stage()->takeNotes();
  ASSERT_THAT(notes, SizeIs(1));
  EXPECT_THAT(notes[0], HasSubstr("the limit is reached"));
  // Copies of other scenes count
  const PageFile other = open("scenes/b.sft", limit);
  expectPages(other);
  EXPECT_LE(pages.stage()->bytesKept() + other.stage()->bytesKept(), limit);
}

TEST_F(PageStageTest, DirectoriesThatCannotServeAreTold) {
  const auto toldOnce = [&](const char* what) {
    const PageFile pages = open();
    expectPages(pages);
    EXPECT_EQ(pages.stage()->bytesKept(), 0u);
    const std::vector<std::string> notes = pages.stage()->takeNotes();
    ASSERT_THAT(notes, SizeIs(1));
    EXPECT_THAT(notes[0], HasSubstr(what));
  };
  // What another user may have laid there
  const std::string file = stagePath();
  std::filesystem::remove(file);
  std::filesystem::create_symlink(path("a.sft"), file);
  const std::string scene = contents("a.sft");
  toldOnce("Too many levels of symbolic links");
  EXPECT_EQ(contents("a.sft"), scene);
  std::filesystem::remove(file);
  std::filesystem::create_directory(file);
  toldOnce("Is a directory");
  std::filesystem::remove_all(path("node"));
  toldOnce("No such file or directory");
}

// Whichever call fails, and how.
TEST_F(PageStageTest, NoFailureOfTheStageIsOneOfTheScene) {
  const std::string stage = stagePath();
  for (const int error : {EIO, ENOSPC, EACCES}) {
    for (int number = 1;; ++number) {
      std::filesystem::remove(stage);
      struct ::stat scene {};
      ASSERT_EQ(::stat(path("a.sft").c_str(), &scene), 0);
      // Not those of the scene
      FailCall fail(number, error, FailCall::Repeat::kOnce, [&](const CallInfo& info) {
        if (info.call == Call::kOpen) return std::string(info.path) == stage;
        struct ::stat other {};
        return ::fstat(info.descriptor, &other) == 0 && other.st_ino != scene.st_ino;
      });
      {
        const Faults faults{&fail};
        const PageFile pages = open();
        expectPages(pages);
        expectPages(pages);
      }
      if (!fail.hasFailed()) break;
      ASSERT_LT(number, 5000);
      number += number / 8;
    }
  }
}

}  // namespace
}  // namespace surfeit
