using System;
using System.Collections.Generic;
using UnityEditor;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// Inspector with a pose controller: clips, still poses, each joint, each expression, of several avatars at once too; and handles
    /// in the scene view that take hands and feet along.
    /// </summary>
    [CustomEditor(typeof(GsacAvatar))]
    [CanEditMultipleObjects]
    public sealed class GsacAvatarEditor : Editor
    {
        const string First = "(the first)";

        int joint = 1;
        int expression;
        Vector3 degrees;
        bool handles = true;

        /// <summary>Unity asks by name whether the key F knows what to frame, and what.</summary>
        public bool HasFrameBounds()
        {
            return ((GsacAvatar)target).CanOpen;
        }

        public Bounds OnGetFrameBounds()
        {
            return GsacSceneBounds.Of((GsacAvatar)target);
        }

        public override void OnInspectorGUI()
        {
            DrawDefaultInspector();
            var avatar = (GsacAvatar)target;
            try
            {
                bool open = avatar.CanOpen && !EditorUtility.IsPersistent(avatar);
                Clip(avatar, open);
                if (!open) return;
                EditorGUILayout.Space();
                Poses(avatar);
                Joint(avatar);
                handles = EditorGUILayout.Toggle("Handles at hands and feet", handles);
                Expression(avatar);
            }
            catch (GsacException e)
            {
                EditorGUILayout.HelpBox(e.Message, MessageType.Error);
            }
        }

        public void OnSceneGUI()
        {
            var avatar = (GsacAvatar)target;
            if (!handles || !avatar.CanOpen || !avatar.IsOpen) return;
            foreach (GsacEnd end in GsacLimb.Ends)
            {
                GsacLimb limb = GsacLimb.Find(avatar.Data, avatar.Joints, end);
                if (limb == null) continue;
                EditorGUI.BeginChangeCheck();
                Vector3 place = Handles.PositionHandle(limb.Tip.position, Quaternion.identity);
                if (EditorGUI.EndChangeCheck()) Change(avatar, () => avatar.Reach(end, place));
            }
        }

        /// <summary>One of the file's clips; a word where the file is not open.</summary>
        void Clip(GsacAvatar avatar, bool open)
        {
            string chosen;
            EditorGUI.BeginChangeCheck();
            if (open)
            {
                var names = new List<string> { First };
                names.AddRange(avatar.Data.Clips.Keys);
                int at = string.IsNullOrEmpty(avatar.Clip) ? 0 : names.IndexOf(avatar.Clip);
                at = EditorGUILayout.Popup("Clip", at, names.ToArray());
                chosen = at > 0 ? names[at] : "";
            }
            else chosen = EditorGUILayout.DelayedTextField("Clip", avatar.Clip);
            if (!EditorGUI.EndChangeCheck()) return;
            foreach (GsacAvatar one in targets)
            {
                Undo.RecordObject(one, "Clip");
                one.Clip = chosen;
            }
        }

        void Poses(GsacAvatar avatar)
        {
            EditorGUILayout.LabelField("Pose", EditorStyles.boldLabel);
            EditorGUILayout.BeginHorizontal();
            foreach (string pose in avatar.Data.Poses.Keys)
            {
                if (!GUILayout.Button(pose + "-pose")) continue;
                foreach (GsacAvatar one in Open())
                {
                    if (one.Data.Poses.ContainsKey(pose)) Change(one, () => one.ShowPose(pose));
                }
            }
            foreach (string clip in avatar.Data.Clips.Keys)
            {
                if (!Application.isPlaying || !GUILayout.Button(clip)) continue;
                foreach (GsacAvatar one in Open())
                {
                    if (one.Data.Clips.ContainsKey(clip)) one.PlayClip(clip);
                }
            }
            EditorGUILayout.EndHorizontal();
        }

        void Joint(GsacAvatar avatar)
        {
            string[] names = avatar.Data.JointNames;
            joint = EditorGUILayout.Popup("Joint", Math.Min(joint, names.Length - 1), names);
            Follow(Turn(avatar, joint));
            EditorGUI.BeginChangeCheck();
            degrees.x = EditorGUILayout.Slider("x, degrees", degrees.x, -180, 180);
            degrees.y = EditorGUILayout.Slider("y", degrees.y, -180, 180);
            degrees.z = EditorGUILayout.Slider("z", degrees.z, -180, 180);
            if (!EditorGUI.EndChangeCheck()) return;
            Quaternion turn = Quaternion.Euler(degrees.x, degrees.y, degrees.z);
            foreach (GsacAvatar one in Open())
            {
                if (one.Data.Joint(names[joint]) >= 0) Change(one, () => one.SetJoint(names[joint], turn));
            }
        }

        /// <summary>Where a joint stands or, while a change to it still fades in, where it will.</summary>
        static Quaternion Turn(GsacAvatar avatar, int joint)
        {
            if (!Application.isPlaying || avatar.Source != GsacSource.Script) return avatar.Joints[joint].localRotation;
            float[] r = avatar.Pose.Rotation;
            return new Quaternion(r[joint * 4], r[joint * 4 + 1], r[joint * 4 + 2], r[joint * 4 + 3]);
        }

        /// <summary>Keeps the angles as they were put in while they are the joint's turn: a turn has several.</summary>
        void Follow(Quaternion turn)
        {
            Quaternion said = Quaternion.Euler(degrees.x, degrees.y, degrees.z);
            float sign = said.x * turn.x + said.y * turn.y + said.z * turn.z + said.w * turn.w < 0 ? -1 : 1;
            float apart = Math.Abs(said.x - sign * turn.x) + Math.Abs(said.y - sign * turn.y) + Math.Abs(said.z - sign * turn.z)
                          + Math.Abs(said.w - sign * turn.w);
            if (apart < 1e-5f) return;
            Vector3 euler = turn.eulerAngles;
            degrees = new Vector3(Mathf.DeltaAngle(0, euler.x), Mathf.DeltaAngle(0, euler.y), Mathf.DeltaAngle(0, euler.z));
        }

        void Expression(GsacAvatar avatar)
        {
            string[] names = avatar.Data.Expressions;
            if (names.Length == 0) return;
            if (avatar.Body == null)
            {
                EditorGUILayout.HelpBox("The child `Body` is missing, whose blend shapes are the expressions: take it back from the prefab",
                                        MessageType.Error);
                return;
            }
            expression = EditorGUILayout.Popup("Expression", Math.Min(expression, names.Length - 1), names);
            EditorGUI.BeginChangeCheck();
            float weight = EditorGUILayout.Slider("weight", avatar.Weights[expression], 0, 1);
            bool moved = EditorGUI.EndChangeCheck(), none = GUILayout.Button("No expression");
            if (!moved && !none) return;
            foreach (GsacAvatar one in Open())
            {
                if (!Application.isPlaying && one.Body != null) Undo.RecordObject(one.Body, "Expression");
                if (none) one.ClearExpressions();
                else if (Array.IndexOf(one.Data.Expressions, names[expression]) >= 0) one.SetExpression(names[expression], weight);
            }
            Redraw();
        }

        /// <summary>The chosen avatars that can be posed.</summary>
        IEnumerable<GsacAvatar> Open()
        {
            foreach (GsacAvatar one in targets)
            {
                if (one.CanOpen && one.IsOpen) yield return one;
            }
        }

        /// <summary>Changes the pose from that in which the person stands, to be undone.</summary>
        static void Change(GsacAvatar avatar, Action change)
        {
            bool playing = Application.isPlaying;
            if (!playing)
            {
                Undo.RecordObject(avatar, "Pose");
                Undo.RecordObjects(avatar.Joints, "Pose");
            }
            if (!playing || avatar.Source != GsacSource.Script) GsacSkeleton.Read(avatar.Pose, avatar.Data, avatar.Joints);
            change();
            if (playing) return;
            avatar.Refresh(0);
            Redraw();
        }

        static void Redraw()
        {
            if (!Application.isPlaying) EditorApplication.QueuePlayerLoopUpdate();
        }
    }
}
