using System;
using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>One avatar's data and the buffers that never change, shared by all its instances in the scene.</summary>
    public sealed class GsacModel
    {
        /// <summary>Buffers of one level of detail.</summary>
        public sealed class Level
        {
            public GsacSort Sort;
            public int Count;
            public GraphicsBuffer Corners;
            public GraphicsBuffer Local;
            public GraphicsBuffer Colours;
        }

        static readonly Dictionary<object, GsacModel> Shared = new Dictionary<object, GsacModel>();

        public readonly GsacData Data;
        public readonly GsacExtent Extent;
        public GraphicsBuffer Rest { get; private set; }
        public GraphicsBuffer Skin { get; private set; }
        public GraphicsBuffer Moves { get; private set; }
        public GraphicsBuffer Quads { get; private set; }

        /// <summary>Pose correctives and where those of a vertex begin; null where the body has none.</summary>
        public GraphicsBuffer Pairs { get; private set; }
        public GraphicsBuffer First { get; private set; }
        public Level[] Levels { get; private set; }

        /// <summary>Keys to sort at the finest level.</summary>
        public int KeyCount { get; private set; }

        /// <summary>The body's mesh, for avatars that no importer gave one.</summary>
        public Mesh Body
        {
            get
            {
                if (body == null) body = GsacMesh.Build(Data);
                return body;
            }
        }

        readonly object source;
        readonly List<GraphicsBuffer> buffers = new List<GraphicsBuffer>();
        IEnumerator<GraphicsBuffer> parts;
        bool uploaded;
        Mesh body;
        int users;

        GsacModel(object source, byte[] bytes)
        {
            this.source = source;
            Data = GsacData.Read(bytes).Mirror();
            Extent = new GsacExtent(Data);
        }

        /// <summary>Reads what nobody uses yet, on any thread. source: what the bytes come from. Throws GsacException.</summary>
        public static GsacModel Read(object source, byte[] bytes)
        {
            return new GsacModel(source, bytes);
        }

        /// <summary>source: what the bytes come from; instances with the same one share. Throws GsacException.</summary>
        public static GsacModel Acquire(object source, byte[] bytes)
        {
            GsacModel model;
            return Acquire(Shared.TryGetValue(source, out model) ? model : Read(source, bytes));
        }

        /// <summary>The one to be used for what was read: the one of before where there is one.</summary>
        public static GsacModel Acquire(GsacModel read)
        {
            GsacModel model;
            if (!Shared.TryGetValue(read.source, out model)) Shared[read.source] = model = read;
            model.users++;
            return model;
        }

        public void Release()
        {
            if (--users > 0) return;
            Shared.Remove(source);
            GsacCameras.Free(body);
            foreach (GraphicsBuffer buffer in buffers) buffer.Dispose();
            buffers.Clear();
        }

        /// <summary>Puts the buffers on the GPU, once.</summary>
        public void Upload()
        {
            while (UploadPart())
            {
            }
        }

        /// <summary>Puts one buffer more on the GPU; false where all are there.</summary>
        public bool UploadPart()
        {
            if (uploaded) return false;
            if (parts == null) parts = Parts();
            uploaded = !parts.MoveNext();
            if (!uploaded) buffers.Add(parts.Current);
            return !uploaded;
        }

        IEnumerator<GraphicsBuffer> Parts()
        {
            int[] first;
            float[] moves = GsacPacking.Moves(Data, out first);
            yield return Rest = Structured(GsacPacking.Rest(Data), 4);
            yield return Moves = Structured(moves, 4);
            yield return Skin = Structured(GsacPacking.Skin(Data, first), 4);
            if (Data.Correctives != null)
            {
                yield return Pairs = Structured(GsacPacking.Pairs(Data.Correctives), 4);
                yield return First = Structured(Data.Correctives.Start, 1);
            }
            var levels = new Level[Data.Levels.Length];
            int most = 0;
            for (int i = 0; i < levels.Length; i++)
            {
                GsacLevel level = Data.Levels[i];
                most = Math.Max(most, level.Count);
                levels[i] = new Level { Count = level.Count, Sort = new GsacSort(level.Count) };
                yield return levels[i].Corners = Structured(GsacPacking.Corners(Data, level), 4);
                yield return levels[i].Local = Structured(GsacPacking.Local(level), 4);
                yield return levels[i].Colours = Structured(GsacPacking.Colours(level), 4);
                KeyCount = Math.Max(KeyCount, levels[i].Sort.KeyCount);
            }
            Levels = levels;
            yield return Quads = Indices(Math.Max(most, 1));
        }

        /// <summary>Two triangles a splat, for `count` of them.</summary>
        public static GraphicsBuffer Indices(int count)
        {
            uint[] quads = GsacPacking.Quads(count);
            var indices = new GraphicsBuffer(GraphicsBuffer.Target.Index, quads.Length, 4);
            indices.SetData(quads);
            return indices;
        }

        /// <summary>width: numbers of four bytes an element. Unity knows no empty buffer.</summary>
        static GraphicsBuffer Structured(Array numbers, int width)
        {
            var buffer = Empty(numbers.Length / width, width);
            if (numbers.Length > 0) buffer.SetData(numbers);
            return buffer;
        }

        public static GraphicsBuffer Empty(int count, int width)
        {
            return new GraphicsBuffer(GraphicsBuffer.Target.Structured, Math.Max(count, 1), width * 4);
        }
    }
}
