using System;
using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// People who stand among each other before one camera: their gaussians in one buffer, sorted together and drawn at once, so
    /// that an arm about another's shoulders is before and behind what it should be.
    /// </summary>
    public sealed class GsacCrowd : IDisposable
    {
        /// <summary>Gaussians that are sorted together at most: 17 bits of a key, which leaves 15 to the depth.</summary>
        public const int Most = 1 << 17;

        const int ThreadsPerGroup = 64;
        static readonly int SplatCountId = Shader.PropertyToID("GsacSplatCount");
        static readonly int SplatsId = Shader.PropertyToID("GsacSplats");
        static readonly int ColoursId = Shader.PropertyToID("GsacColours");
        static readonly int FirstId = Shader.PropertyToID("GsacJoinFirst");
        static readonly int JoinedId = Shader.PropertyToID("GsacJoined");
        static readonly int JoinedColoursId = Shader.PropertyToID("GsacJoinedColours");
        static readonly int[] ModelIds =
        {
            Shader.PropertyToID("GsacJoinModel0"), Shader.PropertyToID("GsacJoinModel1"), Shader.PropertyToID("GsacJoinModel2"),
        };

        struct Member
        {
            public GsacView View;
            public int Shape;
            public int Level;
            public Matrix4x4 Space;
        }

        public readonly Camera Camera;
        readonly ComputeShader kernels, joining;
        readonly int joinKernel;
        readonly GsacSorted sorted = new GsacSorted();
        readonly List<Member> members = new List<Member>();
        GraphicsBuffer splats, colours, indices;
        GsacSort sort;
        int capacity;
        int planned;
        int version;

        public GsacCrowd(Camera camera)
        {
            Camera = camera;
            kernels = Resources.Load<ComputeShader>("Gsac/Gsac");
            joining = Resources.Load<ComputeShader>("Gsac/GsacJoin");
            joinKernel = joining.FindKernel("Join");
        }

        public void Dispose()
        {
            sorted.Dispose();
            if (splats == null) return;
            splats.Dispose();
            colours.Dispose();
            indices.Dispose();
            splats = null;
        }

        /// <summary>Whether two people have to be sorted together, and may be.</summary>
        public static bool Meet(GsacView one, GsacView other)
        {
            GsacData a = one.Model.Data, b = other.Model.Data;
            bool sameRule = a.LowPass == b.LowPass && a.AlphaMax == b.AlphaMax && a.AlphaMin == b.AlphaMin && a.KeepsEnergy == b.KeepsEnergy;
            return sameRule && one.Finish.IsLike(other.Finish) && Touch(one.Bounds, other.Bounds);
        }

        static bool Touch(Bounds a, Bounds b)
        {
            Vector3 away = a.center - b.center, reach = (a.size + b.size) * 0.5f;
            return Math.Abs(away.x) <= reach.x && Math.Abs(away.y) <= reach.y && Math.Abs(away.z) <= reach.z;
        }

        /// <summary>Draws those of `seen` whose group is `leader`, which is the first of them.</summary>
        public void Draw(List<GsacView> seen, int[] group, int leader)
        {
            GsacView first = seen[leader];
            Matrix4x4 space = first.Space;
            var origin = new Vector3(space.m03, space.m13, space.m23); // near the people: large coordinates would lose digits
            int total = 0;
            Vector4 row = first.WorldRow;
            var depths = new GsacDepths { Row = row, Low = float.MaxValue, High = float.MinValue };
            depths.Row.w += row.x * origin.x + row.y * origin.y + row.z * origin.z;
            Bounds bounds = first.Bounds;
            for (int i = leader; i < seen.Count; i++)
            {
                if (group[i] != leader) continue;
                total += seen[i].Level.Count;
                depths.Low = Math.Min(depths.Low, seen[i].Depths.Low);
                depths.High = Math.Max(depths.High, seen[i].Depths.High);
                bounds.Encapsulate(seen[i].Bounds);
            }
            if (total > capacity || splats == null) Reserve(total);
            if (total != planned) Plan(total);
            if (!IsJoined(seen, group, leader)) Join(seen, group, leader, origin);
            sorted.Sort(kernels, splats, total, sort, capacity, depths, version, 0);
            sorted.Draw(Camera, first.Finish, first.Model.Data, Matrix4x4.Translate(origin), splats, colours, indices, total, sort, bounds);
        }

        void Reserve(int total)
        {
            Dispose();
            capacity = GsacSort.Block;
            while (capacity < total) capacity *= 2;
            splats = GsacModel.Empty(capacity * 3, 4);
            colours = GsacModel.Empty(capacity, 4);
            indices = GsacModel.Indices(capacity);
            members.Clear();
        }

        void Plan(int total)
        {
            sort = new GsacSort(total);
            planned = total;
        }

        bool IsJoined(List<GsacView> seen, int[] group, int leader)
        {
            int n = 0;
            for (int i = leader; i < seen.Count; i++)
            {
                if (group[i] != leader) continue;
                if (n == members.Count || !IsLike(members[n], seen[i])) return false;
                n++;
            }
            return n == members.Count;
        }

        static bool IsLike(Member member, GsacView view)
        {
            return ReferenceEquals(member.View, view) && member.Shape == view.Shape && member.Level == view.LevelNumber && member.Space.Equals(view.Space);
        }

        /// <summary>Copies the people's splats into one space, whose origin is given.</summary>
        void Join(List<GsacView> seen, int[] group, int leader, Vector3 origin)
        {
            members.Clear();
            version++;
            int place = 0;
            joining.SetBuffer(joinKernel, JoinedId, splats);
            joining.SetBuffer(joinKernel, JoinedColoursId, colours);
            for (int i = leader; i < seen.Count; i++)
            {
                if (group[i] != leader) continue;
                GsacView view = seen[i];
                members.Add(new Member { View = view, Shape = view.Shape, Level = view.LevelNumber, Space = view.Space });
                for (int r = 0; r < 3; r++)
                {
                    Vector4 row = view.Space.GetRow(r);
                    joining.SetVector(ModelIds[r], new Vector4(row.x, row.y, row.z, row.w - (r == 0 ? origin.x : r == 1 ? origin.y : origin.z)));
                }
                joining.SetInt(SplatCountId, view.Level.Count);
                joining.SetInt(FirstId, place);
                joining.SetBuffer(joinKernel, SplatsId, view.Splats);
                joining.SetBuffer(joinKernel, ColoursId, view.Level.Colours);
                joining.Dispatch(joinKernel, (view.Level.Count + ThreadsPerGroup - 1) / ThreadsPerGroup, 1, 1);
                place += view.Level.Count;
            }
        }
    }
}
