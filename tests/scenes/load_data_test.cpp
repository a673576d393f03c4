// The loader on the real scenes that lie beside the checkout.
#include "gltf_file.h"
#include "tests/support/shared_data.h"

namespace ivis::test {
namespace {

TEST(LoadData, PeerCityHasAHundredThousandInstances) {
  IVIS_NEED_DATA(file, "peer_city/peer_city.glb");
  const auto s = load_scene(file);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->objects.size(), 101605U);
  EXPECT_EQ(s->meshes.size(), 1606U);
  EXPECT_TRUE(s->warnings.empty());
}

TEST(LoadData, LinzCentreHasItsBuildings) {
  IVIS_NEED_DATA(file, "linz/linz_centre_2km.glb");
  const auto s = load_scene(file);
  IVIS_ASSERT_OK(s);
  EXPECT_EQ(s->objects.size(), 6306U);
  EXPECT_EQ(s->triangle_count, 392197U);
}

TEST(LoadData, GameMapsHaveHiddenSolids) {
  for (const auto& [name, faces, solids] : {std::tuple("q3map/oa_shouse.glb", 1757U, 942U),
                                            std::tuple("q3map/czest3ctf.glb", 5778U, 1763U)}) {
    IVIS_NEED_DATA(file, name);
    const auto s = load_scene(file);
    IVIS_ASSERT_OK(s);
    EXPECT_EQ(s->objects.size(), faces) << name;
    EXPECT_EQ(s->hidden_solids.size(), solids) << name;
    for (const Object& o : s->hidden_solids)
      EXPECT_EQ(o.tag, OccluderTag::kOnly);
  }
}

}  // namespace
}  // namespace ivis::test
