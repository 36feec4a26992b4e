using UnityEditor;
using UnityEngine;

namespace Gsac
{
    /// <summary>Inspector with a pose controller: still poses, clips, each joint, each expression.</summary>
    [CustomEditor(typeof(GsacAvatar))]
    public sealed class GsacAvatarEditor : Editor
    {
        int joint = 1;
        int expression;
        Vector3 degrees;

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
            if (!avatar.CanOpen || EditorUtility.IsPersistent(avatar)) return;
            try
            {
                EditorGUILayout.Space();
                Poses(avatar);
                Joint(avatar);
                Expression(avatar);
            }
            catch (GsacException e)
            {
                EditorGUILayout.HelpBox(e.Message, MessageType.Error);
            }
        }

        void Poses(GsacAvatar avatar)
        {
            EditorGUILayout.LabelField("Pose", EditorStyles.boldLabel);
            EditorGUILayout.BeginHorizontal();
            foreach (string pose in avatar.Data.Poses.Keys)
            {
                if (!GUILayout.Button(pose + "-pose")) continue;
                Remember(avatar);
                avatar.ShowPose(pose);
                Show(avatar);
                degrees = Vector3.zero;
            }
            foreach (string clip in avatar.Data.Clips.Keys)
            {
                if (Application.isPlaying && GUILayout.Button(clip)) avatar.PlayClip(clip);
            }
            EditorGUILayout.EndHorizontal();
        }

        void Joint(GsacAvatar avatar)
        {
            EditorGUI.BeginChangeCheck();
            joint = EditorGUILayout.Popup("Joint", joint, avatar.Data.JointNames);
            if (EditorGUI.EndChangeCheck()) degrees = Signed(avatar.Joints[joint].localRotation.eulerAngles);
            EditorGUI.BeginChangeCheck();
            degrees.x = EditorGUILayout.Slider("x, degrees", degrees.x, -180, 180);
            degrees.y = EditorGUILayout.Slider("y", degrees.y, -180, 180);
            degrees.z = EditorGUILayout.Slider("z", degrees.z, -180, 180);
            if (!EditorGUI.EndChangeCheck()) return;
            Remember(avatar);
            if (avatar.Source != GsacSource.Script) GsacSkeleton.Read(avatar.Pose, avatar.Data, avatar.Joints);
            avatar.SetJoint(avatar.Data.JointNames[joint], Quaternion.Euler(degrees.x, degrees.y, degrees.z));
            Show(avatar);
        }

        void Expression(GsacAvatar avatar)
        {
            string[] names = avatar.Data.Expressions;
            if (names.Length == 0) return;
            EditorGUI.BeginChangeCheck();
            expression = EditorGUILayout.Popup("Expression", expression, names);
            float weight = EditorGUILayout.Slider("weight", avatar.Weights[expression], 0, 1);
            if (EditorGUI.EndChangeCheck())
            {
                avatar.SetExpression(names[expression], weight);
                Show(avatar);
            }
            if (GUILayout.Button("No expression"))
            {
                avatar.ClearExpressions();
                Show(avatar);
            }
        }

        static void Remember(GsacAvatar avatar)
        {
            if (Application.isPlaying) return;
            Undo.RecordObject(avatar, "Pose");
            Undo.RecordObjects(avatar.Joints, "Pose");
        }

        static void Show(GsacAvatar avatar)
        {
            if (Application.isPlaying) return;
            avatar.Refresh(0);
            EditorApplication.QueuePlayerLoopUpdate();
        }

        static Vector3 Signed(Vector3 euler)
        {
            return new Vector3(Mathf.DeltaAngle(0, euler.x), Mathf.DeltaAngle(0, euler.y), Mathf.DeltaAngle(0, euler.z));
        }
    }
}
