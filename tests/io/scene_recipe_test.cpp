#include "surfels/generated/scene_recipe.h"

#include <gtest/gtest.h>

#include <string>

namespace surfeit {
namespace {

std::string refusal(const std::string& lines) {
  const Result<SceneRecipe> recipe = parseSceneRecipe(lines, "a.recipe");
  if (recipe.ok()) return "accepted";
  EXPECT_EQ(recipe.status().code(), StatusCode::kCorruption);
  return recipe.status().message();
}

TEST(SceneRecipe, TextGivesTheSameRecipe) {
  SceneRecipe recipe;
  recipe.kind = SceneKind::kVolume;
  recipe.surfels = 1'000'000'000;
  recipe.seed = 18446744073709551615u;
  recipe.order = RecordOrder::kShuffled;
  recipe.part = 2, recipe.part_count = 5;
  recipe.outlier_distance = 1e6 / 3;
  recipe.duplicate_percent = 0.1;
  const std::string text = formatSceneRecipe(recipe);
  const Result<SceneRecipe> parsed = parseSceneRecipe(text, "a.recipe");
  ASSERT_TRUE(parsed.ok()) << parsed.status().message();
  EXPECT_EQ(formatSceneRecipe(*parsed), text);
  EXPECT_EQ(parsed->outlier_distance, recipe.outlier_distance);
  EXPECT_EQ(parsed->seed, recipe.seed);
}

TEST(SceneRecipe, OnlyKindAndSurfelsMustBeThere) {
  const Result<SceneRecipe> recipe =
      parseSceneRecipe("surfeit-recipe 1\r\n# a city\n\nsurfels 12\r\nkind city", "a.recipe");
  ASSERT_TRUE(recipe.ok()) << recipe.status().message();
  EXPECT_EQ(recipe->surfels, 12u);
  EXPECT_EQ(recipe->seed, 1u);
  EXPECT_EQ(recipe->part_count, 1u);
}

TEST(SceneRecipe, MistakesAreNamedWithFileAndLine) {
  const std::string head = "surfeit-recipe 1\nkind city\n";
  EXPECT_EQ(refusal("surfeit-recipe 2\n"),
            "a.recipe: line 1: found 'surfeit-recipe 2', expected 'surfeit-recipe 1'");
  EXPECT_EQ(refusal(""), "a.recipe: line 1: found '', expected 'surfeit-recipe 1'");
  EXPECT_EQ(refusal(head), "a.recipe: found no line 'surfels ...'");
  EXPECT_EQ(refusal("surfeit-recipe 1\nsurfels 3\n"), "a.recipe: found no line 'kind ...'");
  EXPECT_EQ(refusal(head + "surfles 3\n"),
            "a.recipe: line 3: 'surfles': unknown key, expected kind, surfels, seed, order, part, "
            "outlier or duplicates");
  EXPECT_EQ(refusal(head + "kind city\n"), "a.recipe: line 3: 'kind': found a second time");
  EXPECT_EQ(refusal("surfeit-recipe 1\nkind town\n"),
            "a.recipe: line 2: 'kind': found 'town', expected terrain, city or volume");
  EXPECT_EQ(refusal(head + "surfels 10M\n"),
            "a.recipe: line 3: 'surfels': found '10M', expected a whole number");
  EXPECT_EQ(refusal(head + "surfels\n"),
            "a.recipe: line 3: 'surfels': found '', expected a whole number");
  EXPECT_EQ(refusal(head + "surfels 0\n"),
            "a.recipe: line 3: 'surfels': surfels 0: expected 1 to 2^40");
  EXPECT_EQ(refusal(head + "surfels -1\n"),
            "a.recipe: line 3: 'surfels': found '-1', expected a whole number");
  EXPECT_EQ(refusal(head + "part 6/5\n"),
            "a.recipe: line 3: 'part': part 6/5: expected K/N with 1 <= K <= N");
  EXPECT_EQ(refusal(head + "part 5\n"),
            "a.recipe: line 3: 'part': found '5', expected a part such as 2/5");
  EXPECT_EQ(refusal(head + "duplicates 101\n"),
            "a.recipe: line 3: 'duplicates': duplicates 101: expected 0 to 100");
  EXPECT_EQ(refusal(head + "outlier nan\n"),
            "a.recipe: line 3: 'outlier': outlier nan: expected 0 to 5e11");
  EXPECT_EQ(refusal(head + "order sorted\n"),
            "a.recipe: line 3: 'order': found 'sorted', expected scan or shuffled");
}

TEST(SceneRecipe, CountsTakeUnitsOfThousands) {
  EXPECT_EQ(*parseSurfelCount("4096"), 4096u);
  EXPECT_EQ(*parseSurfelCount("2.5k"), 2500u);
  EXPECT_EQ(*parseSurfelCount("10M"), 10'000'000u);
  EXPECT_EQ(*parseSurfelCount("1G"), 1'000'000'000u);
  for (const char* text : {"", "M", "0", "-1", "2T", "10m", "10MB", "nan", "inf", "1e400"}) {
    const Result<std::uint64_t> count = parseSurfelCount(text);
    EXPECT_EQ(count.status().code(), StatusCode::kInvalidArgument) << text;
  }
}

}  // namespace
}  // namespace surfeit
