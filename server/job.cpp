#include "server/job.h"

#include <algorithm>
#include <exception>
#include <thread>
#include <utility>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "wire/object_table.h"

namespace ivis::server {
namespace {

Result<Pvs> solve(const Job& job, Work& done) {
  try {
    if (job.everything) {
      Pvs pvs;
      pvs.everything_because = "the client is far behind, or an edit half done";
      return pvs;
    }
    if (job.amendment) return job.method->solve(job.cell, job.effort, *job.amendment, done);
    if (job.effort.strategy == Strategy::kGuaranteed) return job.method->solve(job.cell);
    return job.method->solve(job.cell, job.effort, done);
  } catch (const std::exception& e) {  // out of memory costs one answer, not the daemon
    return unsupported(e.what());
  }
}

}  // namespace

ServedScene served_scene(const Scene& scene) {
  ServedScene served;
  served.hash = scene.hash;
  served.whole_hash = scene.whole_hash;
  wire::ObjectTable table;
  table.id = rank_order(scene);
  served.order_hash = XXH3_64bits(table.id.data(), table.id.size() * sizeof(ObjectId));
  served.rank_of.resize(scene.object_count());
  for (Rank r = 0; r < table.id.size(); ++r) {
    const Object& o = scene.objects[table.id[r]];
    table.node.push_back(o.node);
    table.instance.push_back(o.instance);
    if (!scene.wholes.empty()) table.cluster.push_back(o.cluster);
    served.rank_of[table.id[r]] = r;
  }
  served.packed_table = wire::pack_table(table);
  return served;
}

JobDone perform(Job job) {
  JobDone done;
  done.session = job.message.session;
  done.sequence = job.message.sequence;
  Work work;
  const auto start = std::chrono::steady_clock::now();
  const Result<Pvs> pvs = solve(job, work);
  if (job.least_solve.count() > 0) std::this_thread::sleep_until(start + job.least_solve);
  const auto took = std::chrono::steady_clock::now() - start;

  wire::PvsMessage& m = job.message;
  m.solve_us = static_cast<std::uint32_t>(std::min<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(took).count(), UINT32_MAX));
  done.failed = !pvs;
  done.cut_short = work.cut;
  try {
    // Errs towards visible: what could not be solved is answered with every object.
    m.everything = !pvs || !pvs->everything_because.empty();
    if (m.everything) {
      m.base = 0;
    } else {
      const ServedScene& scene = *job.scene;
      wire::RankSet set(scene.objects());
      for (const ObjectId id : pvs->objects)
        set.set(scene.rank_of[id]);
      auto after = std::make_shared<wire::PvsState>(scene.objects());
      m.payload =
          wire::encode_pvs(set, job.base ? *job.base : wire::PvsState(scene.objects()), *after);
      done.after = std::move(after);
      done.full = m.base == 0;
    }
    done.bytes = wire::encode(m);
  } catch (const std::exception&) {
    done.bytes.clear();
    done.after.reset();
    done.failed = true;
  }
  done.peer = std::move(job.peer);
  return done;
}

}  // namespace ivis::server
