using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// Expression weights where they stand: on the blend shapes of the body's mesh. So whatever moves blend shapes moves the face:
    /// Timeline, Animators, face trackers; and the scene saves them.
    /// </summary>
    public sealed class GsacShapes
    {
        const float Whole = 100; // Unity's weight of a whole shape

        readonly SkinnedMeshRenderer body;
        readonly int[] shapes;
        readonly int[] jaw = { -1, -1, -1 };

        /// <summary>body: null where there is none; then every weight is 0.</summary>
        public GsacShapes(SkinnedMeshRenderer body, string[] expressions)
        {
            this.body = body;
            shapes = new int[expressions.Length];
            for (int e = 0; e < shapes.Length; e++) shapes[e] = Index(expressions[e]);
            for (int axis = 0; axis < jaw.Length; axis++) jaw[axis] = Index(GsacMesh.JawShapes[axis]);
        }

        int Index(string shape)
        {
            return body == null || body.sharedMesh == null ? -1 : body.sharedMesh.GetBlendShapeIndex(shape);
        }

        /// <summary>Has the mesh follow a turn of the jaw, axis-angle, as the gaussians do.</summary>
        public void ShowJaw(float x, float y, float z)
        {
            if (body == null) return;
            ShowJaw(jaw[0], x * Whole);
            ShowJaw(jaw[1], y * Whole);
            ShowJaw(jaw[2], z * Whole);
        }

        void ShowJaw(int shape, float weight)
        {
            if (shape >= 0 && body.GetBlendShapeWeight(shape) != weight) body.SetBlendShapeWeight(shape, weight);
        }

        public int Count { get { return shapes.Length; } }

        /// <summary>0..1: the weight of an expression.</summary>
        public float this[int expression]
        {
            get { return body == null || shapes[expression] < 0 ? 0 : body.GetBlendShapeWeight(shapes[expression]) / Whole; }
            set { if (body != null && shapes[expression] >= 0) body.SetBlendShapeWeight(shapes[expression], value * Whole); }
        }

        public void Read(float[] weights)
        {
            bool there = body != null;
            for (int e = 0; e < weights.Length; e++)
            {
                weights[e] = there && shapes[e] >= 0 ? body.GetBlendShapeWeight(shapes[e]) / Whole : 0;
            }
        }

        public void Clear()
        {
            for (int e = 0; e < shapes.Length; e++) this[e] = 0;
        }
    }
}
