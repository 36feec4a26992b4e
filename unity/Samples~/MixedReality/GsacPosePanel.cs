using System;
using System.Collections.Generic;
using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>A board in the room with the person's poses, clips and some expressions, and with what else is to be done; a fingertip presses.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac Pose Panel")]
    public sealed class GsacPosePanel : MonoBehaviour
    {
        const float Row = 0.05f, Width = 0.3f, Thick = 0.03f; // m
        static readonly string[] Faces = { "jawOpen", "mouthSmileLeft", "browInnerUp" };

        [SerializeField] GsacCast cast = null;
        [SerializeField, Tooltip("May be empty.")] GsacFloorPlacement placement = null;
        [SerializeField, Tooltip("May be empty.")] GsacMixedReality reality = null;
        [SerializeField, Tooltip("Who knows the fingertips: a component with IGsacHands.")] MonoBehaviour hands = null;

        readonly List<KeyValuePair<string, Action>> rows = new List<KeyValuePair<string, Action>>();
        readonly int[] pressed = { -1, -1 };

        /// <summary>What stands on the board, from above.</summary>
        public string[] Words { get { return rows.ConvertAll(row => row.Key).ToArray(); } }

        void Start()
        {
            GsacAvatar person = cast == null ? null : cast.First;
            if (person == null) return;
            foreach (string pose in person.Data.Poses.Keys) Add(pose + "-pose", () => person.ShowPose(pose));
            foreach (string clip in person.Data.Clips.Keys) Add(clip, () => person.PlayClip(clip));
            foreach (string face in Faces)
            {
                int e = Array.IndexOf(person.Data.Expressions, face);
                if (e >= 0) Add(face, () => person.SetExpression(face, person.Weights[e] > 0 ? 0 : 1));
            }
            if (placement != null) Add("Place here", () => placement.Place());
            if (reality != null) Add("Room", () => reality.Passthrough = !reality.Passthrough);
        }

        void Add(string word, Action done)
        {
            var line = new GameObject(word);
            line.transform.SetParent(transform, false);
            line.transform.localPosition = new Vector3(0, -rows.Count * Row, 0);
            var text = line.AddComponent<TextMesh>();
            text.text = word;
            text.characterSize = 0.004f;
            text.fontSize = 72;
            text.anchor = TextAnchor.MiddleCenter;
            rows.Add(new KeyValuePair<string, Action>(word, done));
        }

        void Update()
        {
            var tracked = hands as IGsacHands;
            if (tracked == null) return;
            for (int side = 0; side < 2; side++)
            {
                Vector3 tip;
                int row = tracked.TryTip(side == 0, out tip) ? RowAt(tip) : -1;
                // once, when the finger comes in
                if (row >= 0 && row != pressed[side]) rows[row].Value();
                pressed[side] = row;
            }
        }

        int RowAt(Vector3 tip)
        {
            Vector3 p = transform.worldToLocalMatrix.MultiplyPoint3x4(tip);
            if (Math.Abs(p.z) > Thick || Math.Abs(p.x) > Width / 2) return -1;
            int row = (int)Math.Round(-p.y / Row);
            return row >= 0 && row < rows.Count ? row : -1;
        }
    }
}
