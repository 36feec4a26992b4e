using System;
using UnityEditor;
using UnityEngine;

namespace Gsac
{
    /// <summary>A clip of a file as Unity's Humanoid AnimationClip: for state machines, Timeline and other people.</summary>
    public static class GsacHumanClip
    {
        static readonly string[] Fingers = { "Thumb", "Index", "Middle", "Ring", "Little" };
        static readonly string[] Root = { "RootT.x", "RootT.y", "RootT.z", "RootQ.x", "RootQ.y", "RootQ.z", "RootQ.w" };

        /// <summary>root, joints: of a person with this Avatar, who is left in the T-pose.</summary>
        public static AnimationClip Build(GsacData data, GsacClip clip, Avatar avatar, Transform root, Transform[] joints)
        {
            var handler = new HumanPoseHandler(avatar, root);
            var human = new HumanPose();
            var pose = new GsacPose(data.JointCount);
            int keys = clip.Loop ? clip.Keys + 1 : clip.Keys; // round to the first
            var values = new float[Root.Length + HumanTrait.MuscleCount][];
            for (int i = 0; i < values.Length; i++) values[i] = new float[keys];
            for (int k = 0; k < keys; k++)
            {
                pose.Sample(clip, k / clip.Fps);
                GsacSkeleton.Apply(pose, data, joints);
                handler.GetHumanPose(ref human);
                Note(human, values, k);
            }
            handler.Dispose();
            GsacSkeleton.Rest(data, joints);
            var made = new AnimationClip { name = clip.Name, frameRate = clip.Fps };
            for (int i = 0; i < values.Length; i++)
            {
                string property = i < Root.Length ? Root[i] : Property(HumanTrait.MuscleName[i - Root.Length]);
                made.SetCurve("", typeof(Animator), property, Line(values[i], clip.Fps));
            }
            AnimationClipSettings settings = AnimationUtility.GetAnimationClipSettings(made);
            settings.loopTime = clip.Loop;
            // the person moves as in the file, and its transform stays
            settings.loopBlendOrientation = settings.loopBlendPositionY = settings.loopBlendPositionXZ = true;
            settings.keepOriginalOrientation = settings.keepOriginalPositionY = settings.keepOriginalPositionXZ = true;
            AnimationUtility.SetAnimationClipSettings(made, settings);
            return made;
        }

        static void Note(HumanPose human, float[][] values, int k)
        {
            Vector3 p = human.bodyPosition;
            Quaternion q = human.bodyRotation;
            // the same turn has two signs: that of the key before
            if (k > 0 && q.x * values[3][k - 1] + q.y * values[4][k - 1] + q.z * values[5][k - 1] + q.w * values[6][k - 1] < 0)
            {
                q = new Quaternion(-q.x, -q.y, -q.z, -q.w);
            }
            float[] row = { p.x, p.y, p.z, q.x, q.y, q.z, q.w };
            for (int i = 0; i < values.Length; i++) values[i][k] = i < row.Length ? row[i] : human.muscles[i - row.Length];
        }

        /// <summary>A muscle's name as clips spell it: fingers with their hand and points, the others as they are called.</summary>
        static string Property(string muscle)
        {
            string[] words = muscle.Split(new[] { ' ' }, 3);
            bool finger = words.Length == 3 && Array.IndexOf(Fingers, words[1]) >= 0;
            return finger ? words[0] + "Hand." + words[1] + "." + words[2] : muscle;
        }

        /// <summary>Straight from key to key.</summary>
        static AnimationCurve Line(float[] values, float fps)
        {
            var keys = new Keyframe[values.Length];
            for (int k = 0; k < keys.Length; k++)
            {
                float before = k > 0 ? (values[k] - values[k - 1]) * fps : 0;
                float after = k + 1 < keys.Length ? (values[k + 1] - values[k]) * fps : 0;
                keys[k] = new Keyframe(k / fps, values[k], before, after);
            }
            return new AnimationCurve(keys);
        }
    }
}
